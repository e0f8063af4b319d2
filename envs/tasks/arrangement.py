"""Layouts of a user's own task in the simulator, where nothing overlaps."""

from __future__ import annotations

import numpy as np

from ...planner import Pose
from ..mujoco_library import mujoco
from ..scene.scene import FIRST_OBJECT, FURNITURE, WORLD
from ..simulation.simulation import Simulation, Start
from .layout import TaskLayout, TaskLayouts

OVERLAP = 0.0005
"""Depth [m] up to which two things that touch at the start do not overlap."""
MAX_DRAWS = 2000
"""Largest number of layouts drawn until one fits."""


class Arrangement:
    """Layouts in which nothing overlaps.

    Args:
        layouts: source of layouts.
        sim: simulation of the task; its state is changed.

    Attributes:
        nominal: layout of level L0.

    Raises:
        BadTask: things overlap in the nominal layout, or it is out of reach.
    """

    def __init__(self, layouts: TaskLayouts, sim: Simulation):
        self._layouts, self._task = layouts, layouts.task
        nominal = layouts.drawn(np.random.default_rng(0), "L0")
        if nominal is None:
            raise self._task.bad("start", "the nominal places are out of reach")
        self.nominal = nominal
        _put(sim, nominal)
        for one, other, depth in _contacts(sim):
            if depth > OVERLAP and {one, other} & set(self._task.names):
                reason = f"{one!r} and {other!r} overlap by {1e3 * depth:.1f} mm at L0: move one of them"
                raise self._task.bad("start", reason)
        model, names = sim.model, set(self._task.names)
        solid = (model.geom_contype != 0) & ((sim.scene.owner >= FIRST_OBJECT) | (sim.scene.owner == FURNITURE))
        geoms = [int(each) for each in np.flatnonzero(solid) if sim.scene.labels[int(each)] in names]
        labels = sim.scene.labels
        pairs = [(a, b) for i, a in enumerate(geoms) for b in geoms[i + 1 :] if labels[a] != labels[b]]
        gap = self._task.apart
        near = {frozenset((labels[a], labels[b])) for a, b in pairs if _gap(sim, a, b, gap) < gap}
        # things that are near each other in the nominal layout are meant to be
        self._apart = [pair for pair in pairs if frozenset(labels[each] for each in pair) not in near]

    def passed(self, name: str, objects: np.ndarray, fixtures: np.ndarray) -> list[Pose]:
        """Return the poses that an object must pass before its goal.

        Args:
            name: of the object.
            objects: (n, 7) poses of the objects.
            fixtures: (m, 7) poses of the fixtures.
        """
        rows = zip(self._task.names, [*objects, *fixtures], strict=True)
        return self._layouts.passed(name, {each: Pose.from_vector(row) for each, row in rows})

    def drawn(
        self, sim: Simulation, rng: np.random.Generator, layout: str, objects: np.ndarray | None = None
    ) -> TaskLayout:
        """Draw a layout; given objects are left where they are.

        Args:
            sim: simulation of the task; its state is changed.
            rng: source of randomness.
            layout: "L0", "L1" or "L2".
            objects: (n, 7) given poses of the objects; None: they are drawn, too.

        Raises:
            BadTask: none of many layouts fits.
        """
        for _ in range(MAX_DRAWS):
            drawn = self._layouts.drawn(rng, layout)
            if drawn is None:
                continue
            if objects is not None:
                return drawn._replace(objects=objects, goals=self._layouts.goals_for(objects, drawn))
            if layout == "L0" or self._fits(sim, drawn):
                return drawn
        robot = sim.scene.robot.name
        why = f"all is on the table, in reach of the {robot} and {1e3 * self._task.apart:g} mm apart"
        raise self._task.bad(
            "start", f"none of {MAX_DRAWS} layouts drawn at {layout} has that {why}: narrow its ranges"
        )

    def _fits(self, sim: Simulation, drawn: TaskLayout) -> bool:
        _put(sim, drawn)
        if any(depth > OVERLAP for *_, depth in _contacts(sim)):
            return False
        gap = self._task.apart
        return all(_gap(sim, a, b, gap) >= gap for a, b in self._apart)


def _put(sim: Simulation, layout: TaskLayout) -> None:
    sim.reset(Start(sim.scene.home, layout.objects, layout.fixtures))


def _contacts(sim: Simulation) -> list[tuple[str, str, float]]:
    """Return names and depth [m] of the contacts of things with each other and with the world."""
    contact, owner, labels = sim.data.contact, sim.scene.owner, sim.scene.labels
    solid, found = (owner[contact.geom] >= FURNITURE) | (owner[contact.geom] == WORLD), []
    for (a, b), distance, of_things in zip(contact.geom, contact.dist, solid.all(axis=1), strict=True):
        one, other = sorted((labels[int(a)], labels[int(b)]))
        if of_things and one != other:
            found.append((one, other, -float(distance)))
    return found


def _gap(sim: Simulation, one: int, other: int, most: float) -> float:
    """Return the distance [m] of two geoms, or `most` if that is smaller."""
    return mujoco.mj_geomDistance(sim.model, sim.data, one, other, most, None) if most else 0.0
