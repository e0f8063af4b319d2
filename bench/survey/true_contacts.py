"""Self-contact of a robot by its true meshes, beside what its body says."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from ...planner import PlanSettings
from ...planner.collision.robot_arrays import robot_arrays
from ...planner.fitting.robot_model import places_of
from ...planner.fitting.robot_parts import pieces_of_links
from ...planner.fitting.self_contacts import distances_of_pairs
from ...planner.geometry.shapes import pack
from ...planner.planning.planning_scene import PlanningScene
from ...planner.robot.body import BODY
from ..robot.load_robot import LoadedRobot, RobotRequest, kind_of
from ..robot.mesh_judge import MeshJudge
from ..robot.mujoco_solids import MujocoSolids
from ..robot.robot_summary import swept_parts
from ..robot.true_solids import TrueSolids
from ..robot.urdf_solids import UrdfSolids

CLEAR = 0.01
"""Distance [m] from which a posture counts as clear of itself, and below which parts count as resting."""
NEAR = 0.02
"""Distance [m] below which distances are compared."""
MOSTLY = 0.95
"""Share of postures in which resting parts are near each other."""

Names = tuple[str, str]


class TrueRobot(NamedTuple):
    """A robot's true shapes, and which of them can hit each other.

    Attributes:
        solids: its collision elements; their links are named like the parts of its body.
        pairs: by names of two parts, in the order of the body, the pairs of elements; neighbors, which share a joint,
            and what the SRDF exempts are left out.
    """

    solids: TrueSolids
    pairs: dict[Names, list[tuple[int, int]]]

    def judge(self, resting: Sequence[Names]) -> MeshJudge:
        """Return the judge of motions.

        Args:
            resting: pairs of parts that always touch, which are not checked.
        """
        return MeshJudge(
            self.solids, [pair for names, pairs in self.pairs.items() if names not in resting for pair in pairs]
        )

    def distances(self, q: np.ndarray) -> dict[Names, float]:
        """Return the distances [m] of all parts nearer than `NEAR`; not above 0 for those that cross.

        Args:
            q: (dof,) joints [rad or m].
        """
        centers, balls, found = self.solids.move(q), self.solids.balls, {}
        for names, pairs in self.pairs.items():
            least = np.inf
            for one, other in pairs:
                gap = float(np.linalg.norm(centers[one] - centers[other])) - balls[one] - balls[other]
                if gap < min(NEAR, least):
                    least = min(least, self.solids.distance(one, other))
            if least < NEAR:
                found[names] = least
        return found


def true_robot(robot: LoadedRobot, request: RobotRequest) -> TrueRobot:
    """Return the true shapes of a robot, read anew from its file.

    Args:
        robot: the robot.
        request: the request that it answers.
    """
    held, dof, body = robot.arm.report.held, robot.arm.dof, robot.body
    solids: Any
    if kind_of(request.file) == "mujoco":
        from ...envs.mujoco_library import compiled_model

        model = compiled_model(request.file)
        names = [place.piece for place in places_of(robot.parts.robot.parts, dof)]
        solids = MujocoSolids(model, robot.arm.joint_names, held, names, visuals=request.visuals)
    else:
        pieces = pieces_of_links(robot.parts, dof)
        solids = UrdfSolids(
            request.file,
            robot.arm.joint_names,
            held,
            request.base,
            package_dirs=request.package_dirs,
            covered=pieces,
            visuals=request.visuals,
        )
        solids.links = [pieces[link] for link in solids.links]
    frames = {name: int(frame) for name, frame in zip(body.names, body.rows[:, BODY.frame], strict=True)}
    order = {name: k for k, name in enumerate(dict.fromkeys(body.names))}
    exempt = {frozenset(pair) for pair in robot.ignored}
    pairs: dict[Names, list[tuple[int, int]]] = {}
    for one, other in combinations(range(len(solids.links)), 2):
        first, second = sorted((one, other), key=lambda k: order[solids.links[k]])
        names = solids.links[first], solids.links[second]
        if abs(frames[names[0]] - frames[names[1]]) > 1 and frozenset(names) not in exempt:
            pairs.setdefault(names, []).append((first, second))
    return TrueRobot(solids, pairs)


class SelfContact(NamedTuple):
    """Findings about the self-contact of random postures, the body's beside the truth.

    Attributes:
        postures: number of them.
        refused: share that the planner refuses.
        touching: share in which true shapes touch.
        clear: share in which all true shapes are `CLEAR` apart.
        clear_refused: share of these that the planner refuses; None: there are none.
        compared: number of pairs of parts in postures whose distances were compared.
        most_over: largest distance [m] by which a pair of parts seems farther apart than it is, and the pair.
        most_under: largest distance [m] by which one seems closer, and the pair.
        resting: pairs of parts that nearly always are near each other, so that they are not checked.
    """

    postures: int
    refused: float
    touching: float
    clear: float
    clear_refused: float | None
    compared: int
    most_over: tuple[float, str]
    most_under: tuple[float, str]
    resting: list[list[str]]


def self_contact(robot: LoadedRobot, truth: TrueRobot, postures: np.ndarray) -> SelfContact:
    """Measure the self-contact of a robot.

    Args:
        robot: the robot.
        truth: its true shapes.
        postures: (n, dof) [rad or m].
    """
    scene = PlanningScene.of(robot.arm, robot.body, (), PlanSettings())
    refused = np.array([scene.slack(q) < 0.0 for q in postures])
    found = [truth.distances(q) for q in postures]
    resting = [names for names in truth.pairs if np.mean([each.get(names, np.inf) < CLEAR for each in found]) >= MOSTLY]
    least = np.array(
        [min((value for names, value in each.items() if names not in resting), default=np.inf) for each in found]
    )
    clear = least >= CLEAR
    gaps = _gaps(robot, postures, found)
    over = max(gaps, default=(0.0, "–"))
    under = min(gaps, default=(0.0, "–"))
    return SelfContact(
        len(postures),
        float(refused.mean()),
        float((least <= 0.0).mean()),
        float(clear.mean()),
        float(refused[clear].mean()) if clear.any() else None,
        len(gaps),
        (max(over[0], 0.0), over[1]),
        (max(-under[0], 0.0), under[1]),
        [list(names) for names in resting],
    )


def _gaps(robot: LoadedRobot, postures: np.ndarray, found: Sequence[dict[Names, float]]) -> list[tuple[float, str]]:
    """Return by how much [m] checked parts that are near but apart seem farther apart than they are, and their names.

    Parts that seem to touch have no depth: they count as at a distance of 0. What is swept is left out: its body is
    where it may be, its meshes are where it is.
    """
    body, swept = robot.body, swept_parts(robot)
    pairs = np.array(body.pairs or (), dtype=int).reshape(-1, 2)
    mine = distances_of_pairs(robot_arrays((robot.arm,), (body,), pack(())), postures, pairs)
    by_parts: dict[Names, list[int]] = {}
    for k, (i, j) in enumerate(pairs):
        by_parts.setdefault((body.names[i], body.names[j]), []).append(k)
    gaps = []
    for k, each in enumerate(found):
        for names, true in each.items():
            columns = by_parts.get(names, by_parts.get((names[1], names[0])))
            if columns and 0.0 < true < NEAR and not swept & set(names):
                gaps.append((max(float(mine[k, columns].min()), 0.0) - true, f"{names[0]} and {names[1]}"))
    return gaps
