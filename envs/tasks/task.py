"""A user's own task as data."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import OneDemoError
from ..errors import BadTask
from .places import At, Range
from .success import Success, Tolerance
from .things import Fixture, Movable

NAME = re.compile(r"[a-z][a-z0-9]*(_[a-z0-9]+)*")
TAKEN = re.compile(r"table|fingers|hand|held|world|floor|(robot|gripper|obstacle|bead|fixed|mount).*")
"""Names of things that the scene has already."""
TABLE_EDGE = 0.36
"""Largest |x| and |y| of a nominal place on the table [m]."""


@dataclass(frozen=True, eq=False)
class Task:
    """A task at the table, as data; see docs/your_task.md.

    Attributes:
        name: unique, in small letters, like "peg_in_hole"; the environment is then onedemo/PegInHole-v0.
        summary: one sentence on what is to be done.
        objects: things that the robot can move, in the order of `object_pose`.
        start: where every object and fixture stands, and how far it is moved at a level.
        success: when the task is done.
        fixtures: things that it cannot move, in the order of `furniture_pose`.
        goals: where objects must come to be, in the order of `goal_pose`: at another thing, or in a range on the table.
        demonstration: file of the ONE demonstration, looked for beside the module of the task; "" as long as there is
            none.
        skill: what the demonstration shows (`onedemo.skill_of`), if it is written by hand; None: found in it.
        grasps: poses of the hand in an object's frame that can hold it, by object: only to place obstacles; missing
            ones are from above.
        passes: places that an object must pass before its goal, as a sponge passes all of a board: only to leave them
            clear of obstacles; missing ones are none.
        apart: least gap [m] between things at the start.
        seconds: time limit [s].
        script: motions (`onedemo.baselines.ScriptedMotion`) that do the task for the first observation, for
            `onedemo demo record`; None: none.

    Raises:
        BadTask: a field that cannot be used; the error names it.
    """

    name: str
    summary: str
    objects: tuple[Movable, ...]
    start: Mapping[str, Range]
    success: Success
    fixtures: tuple[Fixture, ...] = ()
    goals: Mapping[str, At | Range] = field(default_factory=dict)
    demonstration: str | Path = ""
    skill: Any = None
    grasps: Mapping[str, tuple[Pose, ...]] = field(default_factory=dict)
    passes: Mapping[str, tuple[At, ...]] = field(default_factory=dict)
    apart: float = 0.02
    seconds: float = 60.0
    script: Callable[[dict[str, np.ndarray]], Iterable[Any]] | None = None

    def __post_init__(self):
        if not isinstance(self.name, str) or not NAME.fullmatch(self.name):
            raise self.bad("name", "is not of small letters, digits and single underscores, like peg_in_hole")
        for key, kind in (("objects", Movable), ("fixtures", Fixture)):
            things = getattr(self, key)
            if isinstance(things, kind) or not isinstance(things, tuple | list):
                raise self.bad(key, f"is no tuple of {kind.__name__}: write ({kind.__name__}(…),)")
            for each in things:
                if not isinstance(each, kind):
                    raise self.bad(key, f"hold {each!r}; expected a {kind.__name__}")
            object.__setattr__(self, key, tuple(things))
        if not self.objects:
            raise self.bad("objects", "are none: there is nothing to move")
        if not isinstance(self.success, Success):
            raise self.bad("success", f"is a {type(self.success).__name__}, not a Success")
        self._check_names()
        self._check_ranges()
        self._check_goals()
        if not (isinstance(self.seconds, int | float) and 0.0 < self.seconds <= 3600.0):
            raise self.bad("seconds", f"{self.seconds!r} is not a time from 0 to 3600 s")

    def __copy__(self) -> Task:
        return self

    def __deepcopy__(self, memo: object) -> Task:
        return self

    @property
    def id(self) -> str:
        """Gymnasium id of the environment."""
        return f"onedemo/{''.join(word.capitalize() for word in self.name.split('_'))}-v0"

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the objects, then of the fixtures."""
        return tuple(each.name for each in (*self.objects, *self.fixtures))

    def tolerance(self, name: str) -> Tolerance:
        """Return the tolerance of an object at its goal."""
        return self.success.tolerances.get(name, Tolerance())

    def bad(self, key: str, reason: str) -> BadTask:
        """Return the error of a field.

        Args:
            key: name of the field.
            reason: why it cannot be used, and what to write instead.
        """
        return BadTask(self.name, key, reason)

    def _check_names(self) -> None:
        for name in self.names:
            if not isinstance(name, str) or not NAME.fullmatch(name):
                raise self.bad("name of a thing", f"{name!r} is not of small letters, digits and single underscores")
            if TAKEN.fullmatch(name):
                raise self.bad("name of a thing", f"{name!r} is a name that the scene has already; choose another")
            if self.names.count(name) > 1:
                raise self.bad(
                    "name of a thing", f"{name!r} is there twice: objects and fixtures need names of their own"
                )
        self._check_known("start", self.start, self.names)
        for name in self.names:
            if name not in self.start:
                raise self.bad("start", f"does not say where {name!r} stands: write start={{{name!r}: Range((x, y))}}")
        objects = [each.name for each in self.objects]
        self._check_known("goals", self.goals, objects)
        self._check_known("grasps", self.grasps, objects)
        self._check_known("passes", self.passes, [name for name in objects if name in self.goals])
        self._check_known("success.undisturbed", self.success.undisturbed, objects)
        for name, most in self.success.undisturbed.items():
            if np.shape(most) != (2,) or not all(isinstance(each, int | float) and each >= 0.0 for each in most):
                raise self.bad("success.undisturbed", f"of {name!r} is {most!r}; expected (distance in m, turn in rad)")
        self._check_known("success.tolerances", self.success.tolerances, objects)
        for name in self.success.tolerances:
            if name not in self.goals:
                raise self.bad("success.tolerances", f"{name!r} has no goal: write goals={{{name!r}: At(…)}}")

    def _check_known(self, key: str, names: Iterable[str], known: Iterable[str]) -> None:
        allowed = list(known)
        for name in names:
            if name not in allowed:
                raise self.bad(key, f"{name!r} is not in the task, which has {', '.join(allowed)}")

    def _check_ranges(self) -> None:
        for key, ranges in (("start", self.start), ("goals", self.goals)):
            for name, where in ranges.items():
                if not isinstance(where, Range) and not (key == "goals" and isinstance(where, At)):
                    expected = "a Range" if key == "start" else "At(…) or a Range"
                    raise self.bad(key, f"of {name!r} is {where!r}; expected {expected}")
                if isinstance(where, Range):
                    self._check_range(key, name, where)

    def _check_range(self, key: str, name: str, where: Range) -> None:
        try:
            places = [where.nominal(robot) for robot in ("", *where.robots)]
            reaches = [where.reach(layout) for layout in ("L1", "L2")]
            numbers = np.concatenate([*places, *(shift for shift, _ in reaches), [turn for _, turn in reaches]])
            usable = all(place.shape == (2,) for place in places) and len(where.shift) == len(where.turn) == 2
        except (TypeError, ValueError, IndexError):
            numbers, usable = np.zeros(1), False
        if not usable or not np.isfinite(numbers).all():
            form = "Range((x, y), shift=(L1, L2), turn=(L1, L2)) in meters and radians"
            raise self.bad(key, f"of {name!r} is {where!r}; expected {form}")
        if max(abs(turn) for _, turn in reaches) > math.pi:
            raise self.bad(key, f"{name!r} turns by {where.turn}: more than half a turn; in radians, np.deg2rad(…)?")
        for place in places:
            if np.abs(place).max() > TABLE_EDGE:
                at = f"({place[0]:g}, {place[1]:g})"
                raise self.bad(key, f"{name!r} at {at} is off the table: |x| and |y| are at most {TABLE_EDGE:g} m")

    def _check_goals(self) -> None:
        for name, where in self.goals.items():
            if isinstance(where, At):
                self._check_place("goals", name, where)
        for name, places in self.passes.items():
            if not isinstance(places, tuple | list) or not all(isinstance(each, At) for each in places):
                raise self.bad("passes", f"of {name!r} are {places!r}; expected (At(…), …)")
            for each in places:
                self._check_place("passes", name, each)
        for name in self.goals:
            _ = self._chain(name)
        if not self.goals and self.success.also is None:
            raise self.bad("success", "never comes: give goals, or a condition also=…")
        for each in self.objects:
            try:
                _ = each.body
            except OneDemoError as error:
                raise self.bad("objects", f"{each.name!r}: {error}") from None

    def _check_place(self, key: str, name: str, where: At) -> None:
        if where.thing not in self.names:
            reason = f"refers to {where.thing!r}, which is not in the task; it has {', '.join(self.names)}"
            raise self.bad(key, f"{name!r} {reason}")
        if where.thing == name:
            raise self.bad(key, f"{name!r} refers to itself")
        rotation = np.asarray(where.rotation, dtype=np.float64)
        if rotation.shape != (4,) or not math.isclose(float(np.linalg.norm(rotation)), 1.0, abs_tol=1e-3):
            raise self.bad(key, f"the rotation of {name!r} is no unit quaternion wxyz")

    def _chain(self, name: str) -> list[str]:
        """Return the things that a goal refers to, one through the other; refuse a circle."""
        found, where = [name], self.goals[name]
        while isinstance(where, At) and where.thing in self.goals:
            if where.thing in found:
                raise self.bad("goals", f"refer to each other in a circle: {' to '.join([*found, where.thing])}")
            found.append(where.thing)
            where = self.goals[where.thing]
        return found
