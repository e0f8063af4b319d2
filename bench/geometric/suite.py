"""The frozen scenarios of the geometric tier: drawn by seed, feasible for the arm, and equal for every method."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig
from ...envs import ScheduledObstacle
from ...envs.core.obstacle_placement import placed
from ...envs.core.placement_context import ObstacleRequest, PlacementContext, PlacementMotion
from ...planner import Box, Capsule, Obstacle, Pose, Shape, Sphere
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadOption
from ..atomic_files import canonical, sha256_of, write_whole
from ..console import counted
from .parts import KINDS, CarriedPart, part_named, robot

FILE = "suite.jsonl"
VERSION = 1
DIGITS = 6
"""Decimals of positions, quaternions and sizes; values are rounded when drawn, so that the file holds them exactly."""
TRIES = 400
"""Largest number of draws per scenario."""
MARGIN = 0.05
"""Smallest distance [rad] of the postures at start and goal to the joint limits."""
SEEDS = 12
"""Initial guesses of the inverse kinematics."""
FLOOR = 0.8
"""Height of the table top [m]."""


@dataclass(frozen=True, slots=True)
class Spread:
    """Ranges of the random displacements of start and goal.

    Attributes:
        start: displacement of the start to each side [m]; a fourth of it upwards and downwards.
        start_yaw: rotation of the start about the vertical to each side [rad].
        goal: displacement of the goal, as `start`.
        goal_yaw: rotation of the goal, as `start_yaw`.
        obstacles: largest number of obstacles, the smallest being one; 0: none.
    """

    start: float
    start_yaw: float
    goal: float
    goal_yaw: float
    obstacles: int = 0


FAR = Spread(0.15, np.deg2rad(60.0), 0.20, np.deg2rad(120.0))
LEVELS = {
    "L1": Spread(0.05, np.deg2rad(15.0), 0.10, np.deg2rad(30.0)),
    "L2": FAR,
    "L3": Spread(FAR.start, FAR.start_yaw, FAR.goal, FAR.goal_yaw, 3),
}


@dataclass(frozen=True, slots=True)
class GeometricScenario:
    """A path to make.

    Attributes:
        index: index in the suite.
        part: one of `KINDS`.
        level: one of `LEVELS`.
        start: start pose of the tcp.
        goal: goal pose of the tcp.
        joints: (dof,) posture of the arm at the start [rad].
        obstacles: static obstacles on the path.
        draws: number of draws until the scenario was feasible.
    """

    index: int
    part: str
    level: str
    start: Pose
    goal: Pose
    joints: tuple[float, ...]
    obstacles: tuple[Obstacle, ...]
    draws: int


def cells() -> list[tuple[str, str]]:
    """Return the combinations of part and level that have scenarios."""
    return [(part, level) for part, kind in KINDS.items() for level in LEVELS if kind.blocked or level != "L3"]


def drawn(index: int, seed: int) -> dict[str, Any]:
    """Draw a scenario of a suite, and return it as written in the file.

    Args:
        index: index in the suite.
        seed: random seed of the suite.

    Raises:
        BadOption: none of `TRIES` draws was feasible.
    """
    name, level = cells()[index % len(cells())]
    part, rng = part_named(name), np.random.default_rng([seed, index])
    for draws in range(1, TRIES + 1):
        found = _drawn_once(part, LEVELS[level], rng)
        if found is not None:
            start, goal, joints, obstacles = found
            return {
                "index": index,
                "part": name,
                "level": level,
                "start": _rounded(start.vector),
                "goal": _rounded(goal.vector),
                "joints": _rounded(joints),
                "obstacles": [_written(each) for each in obstacles],
                "draws": draws,
            }
    raise BadOption("seed", f"{seed} gives no feasible scenario {index} ({name}, {level}) in {TRIES} draws")


def _drawn_once(part: CarriedPart, far: Spread, rng: np.random.Generator) -> tuple | None:
    """Draw start, goal, joints and obstacles; None if the arm cannot reach both ends or the obstacles do not fit."""
    shown = part.shown
    start = _moved(shown[0], shown[0].position, far.start, far.start_yaw, rng)
    goal = _moved(shown[-1], part.reference, far.goal, far.goal_yaw, rng)
    joints = _posture(start, part.joints, rng)
    if joints is None or _posture(goal, joints, rng) is None:
        return None
    if not far.obstacles:
        return start, goal, joints, ()
    up = Pose.from_position_quaternion([0.0, 0.0, part.kind.raised])
    above = ((up @ goal,),) if part.kind.raised else ()
    motion = PlacementMotion(up @ start, up @ goal, ((start,), *above, (goal,)), part.shape, part.tcp_from_object, 0)
    context = PlacementContext([motion], robot().arm, robot().body, joints, [], [], FLOOR)
    orders = [ObstacleRequest("static", 0)] * int(rng.integers(1, far.obstacles + 1))
    found = placed(rng, "static", context, orders)
    return None if found is None else (start, goal, joints, found)


def _moved(pose: Pose, center: np.ndarray, far: float, yaw: float, rng: np.random.Generator) -> Pose:
    """Return a pose turned about the vertical through a center and displaced, rounded as in the file."""
    offset = rng.uniform(-1.0, 1.0, 3) * far * np.array([1.0, 1.0, 0.25])
    turn = Pose.from_yaw([0.0, 0.0, 0.0], rng.uniform(-yaw, yaw))
    away, back = (Pose.from_position_quaternion(sign * center + k * offset) for sign, k in ((1, 1), (-1, 0)))
    return _pose(_rounded((away @ turn @ back @ pose).vector))


def _posture(pose: Pose, near: np.ndarray, rng: np.random.Generator) -> np.ndarray | None:
    """Return joints (dof,) [rad] at a pose, away from the limits; None if there is no solution."""
    arm = robot().arm
    for guess in [near, *rng.uniform(arm.lower, arm.upper, (SEEDS - 1, arm.dof))]:
        q = inverse_kinematics(arm, pose, guess)
        if q is not None and arm.margin(q) >= MARGIN:
            return q
    return None


def _rounded(values: Any) -> list[float]:
    return [round(float(value), DIGITS) for value in values]


def _pose(vector: Sequence[float]) -> Pose:
    """Return a pose from a vector with a rounded quaternion."""
    turn = np.array(vector[3:])
    return Pose.from_position_quaternion(vector[:3], turn / np.linalg.norm(turn))


def _written(one: ScheduledObstacle) -> dict[str, Any]:
    shape = one.shape
    size: dict[str, Any] = {}
    if isinstance(shape, Box):
        size["size"] = _rounded(shape.size)
    if isinstance(shape, Sphere | Capsule):
        size["radius"] = round(shape.radius, DIGITS)
    if isinstance(shape, Capsule):
        size["length"] = round(shape.length, DIGITS)
    return {"shape": type(shape).__name__.lower(), **size, "pose": _rounded([*one.center, *one.rotation])}


def _shape(values: Mapping[str, Any]) -> Shape:
    if values["shape"] == "box":
        return Box(tuple(values["size"]))
    if values["shape"] == "capsule":
        return Capsule(values["radius"], values["length"])
    return Sphere(values["radius"])


def scenario_of(values: Mapping[str, Any]) -> GeometricScenario:
    """Return a scenario from its line in the file."""
    obstacles = tuple(
        Obstacle(_shape(each), _pose(each["pose"]), name=f"obstacle{k}") for k, each in enumerate(values["obstacles"])
    )
    return GeometricScenario(
        values["index"], values["part"], values["level"], _pose(values["start"]), _pose(values["goal"]),
        tuple(values["joints"]), obstacles, values["draws"],
    )  # fmt: skip


class GeometricSuite:
    """All scenarios of a geometric run.

    Args:
        seed: random seed of the scenarios.
        lines: one mapping per scenario, in order.
    """

    def __init__(self, seed: int, lines: Sequence[Mapping[str, Any]]):
        self.seed, self.lines = seed, list(lines)
        self.hash = sha256_of(self.lines)
        self.scenarios = [scenario_of(line) for line in self.lines]

    def write(self, folder: Path) -> None:
        """Write the file: a head with the hash, then a line for each scenario."""
        head = {"version": VERSION, "seed": self.seed, "count": len(self.lines), "suite": self.hash}
        write_whole(folder / FILE, "".join(canonical(line) + "\n" for line in [head, *self.lines]))


def read_suite(folder: Path) -> GeometricSuite | None:
    """Return the suite of a folder; None if there is none.

    Raises:
        BadConfig: the file is invalid, of another version, or was changed.
    """
    file = folder / FILE
    if not file.is_file():
        return None
    try:
        head, *lines = (json.loads(line) for line in file.read_text(encoding="utf-8").splitlines())
        if head["version"] != VERSION:
            raise BadConfig(file, "version", f"is {head['version']!r}; known: {VERSION}")
        suite = GeometricSuite(head["seed"], lines)
    except (ValueError, TypeError, KeyError) as error:
        if isinstance(error, BadConfig):
            raise
        raise BadConfig(file, "", f"is not a list of scenarios: {type(error).__name__} {error}") from None
    if suite.hash != head.get("suite"):
        raise BadConfig(file, "suite", "is not the hash of the scenarios: the file has been changed")
    return suite


def suite_line(suite: GeometricSuite) -> str:
    """Return the numbers of scenarios and infeasible draws in words."""
    draws = sum(each.draws for each in suite.scenarios)
    count = len(suite.scenarios)
    refused = f"{draws - count} of {counted(draws, 'draw')} not feasible and drawn anew"
    return f"{counted(count, 'scenario')}, suite {suite.hash[:12]}; {refused}"
