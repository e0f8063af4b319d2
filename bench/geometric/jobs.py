"""Worker of the geometric tier: draws scenarios, makes paths and measures them.

Three tracks: `paths`, the levels; `sparse`, the demonstration thinned to a few key poses; `frames`, the same path made
in another tool frame or another world, and expressed back. A row depends on its scenario, track, variant and method
only; just its last number, the time, differs from run to run.
"""

from __future__ import annotations

import math
import time
from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...baselines.key_poses import Join, filled
from ...baselines.motion.motion_method import MotionPlanner
from ...baselines.motion.path_generators import straight_path
from ...baselines.paths_only import made_path, motion_planner
from ...planner import Obstacle, Pose, PosePath, guide_index, imitated_path
from ...planner.errors import NotFinite, NotUnit, OneDemoError, PlanFailed
from ...planner.imitation.segmentation import key_poses
from ...planner.imitation.tsia import GUIDE_START, screw_path
from ...planner.robot.body import TOOL_CAPSULE
from ..atomic_files import sha256_of
from ..workers.worker_process import main
from . import metrics
from .clearance import ToolJudge
from .parts import CarriedPart, holding, part_named, robot, tool_of
from .suite import GeometricScenario, GeometricSuite, drawn, read_suite

SHIPPED_GUIDE = 0.5
"""Guiding pose of the shipped configs, as a fraction of the path length."""
COMMON = 0.3
"""Fraction of the demonstration from which all methods are compared with it if it is thinned: key poses shift the
guiding pose slightly."""
LEAST_TURNING = 0.1
"""Rotation [rad] of a demonstration below which a path's rotation is not divided by it."""
KEY_POSES = (600, 60, 24, 12, 6, 4)
"""Numbers of key poses in the track "sparse"."""
TOOL = Pose.from_position_quaternion(np.full(3, 0.1 / math.sqrt(3.0)), [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
"""The other tool frame in the tcp's frame: 10 cm away, turned by 90 degrees."""
WORLD = Pose.from_position_quaternion([0.7, -0.4, 0.3], [0.5, 0.1, -0.7, 0.5])
"""The other world frame: none of its axes is parallel to an old axis."""
FRAMES = ("tool", "tool, guide by length", "world", "recorded elsewhere")
"""Changed frames: the tool frame, with the same guiding pose or with the guiding pose at the same fraction of the new
path length; the whole world; or the demonstration's world alone, as if recorded on another table."""
ELSEWHERE = Pose.from_yaw([0.3, 0.5, 0.0], np.deg2rad(70.0))
"""Displacement of a demonstration recorded on another table."""


class Method(NamedTuple):
    """A row of the tables.

    Attributes:
        generator: name of the policy whose path generator is used.
        guide: fraction of the path length at which blending into the imitated path ends.
        join: interpolation between key poses.
        planned: True: the path of an arm whose motion was planned; False: the path of a free-flying tool.
    """

    generator: str
    guide: float = GUIDE_START
    join: Join = straight_path
    planned: bool = False


METHODS = {
    "screw": Method("screw", join=screw_path, planned=True),
    "repet": Method("screw", join=screw_path),
    "tsia": Method("tsia", join=screw_path),
    "tsia, guide 0.5": Method("tsia", SHIPPED_GUIDE, screw_path),
    "decoupled": Method("decoupled"),
    "replay": Method("replay"),
    "dmp-goal": Method("dmp-goal"),
    "dmp-goal, screws": Method("dmp-goal", join=screw_path),
    "dmp-world": Method("dmp-world"),
    "potential": Method("potential", join=screw_path),
    "rrt": Method("rrt", planned=True),
}
"""Methods by name: `screw` is the whole method, `repet` is imitation with escape trees alone; joins matter if key poses
are few."""
TRACKS = {
    "paths": tuple(name for name in METHODS if name != "dmp-goal, screws"),
    "sparse": ("tsia", "decoupled", "replay", "dmp-goal", "dmp-goal, screws", "dmp-world"),
    "frames": ("repet", "tsia", "decoupled", "replay", "dmp-goal", "dmp-world", "potential"),
}
"""Methods of each track; of methods that must give equal paths, one is included."""
Row = dict[str, Any]
"""Numbers of one path."""


def rows_of(scenario: GeometricScenario, track: str, variant: str, methods: Sequence[str]) -> list[Row]:
    """Return a row for each method.

    Args:
        scenario: the scenario.
        track: one of `TRACKS`.
        variant: variant of the track: level, number of key poses, or one of `FRAMES`.
        methods: names from `METHODS`.
    """
    one = {"paths": path_row, "sparse": sparse_row, "frames": frames_row}[track]
    head = {"track": track, "variant": variant, "index": scenario.index, "part": scenario.part, "level": scenario.level}
    return [{**head, "method": name, **one(scenario, variant, name)} for name in methods]


def path_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """Return the numbers of a method's path in a scenario.

    Args:
        scenario: the scenario.
        variant: unused; the signature is common to all tracks.
        name: name of the method.
    """
    return measured(scenario, name, part_named(scenario.part).shown)


def sparse_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """Return the numbers of a path made from a few key poses, compared with the whole demonstration.

    Args:
        scenario: the scenario.
        variant: number of key poses.
        name: name of the method.
    """
    part = part_named(scenario.part)
    keys = key_poses(part.shown, int(variant))
    return measured(scenario, name, filled(keys, METHODS[name].join), aligned_from=COMMON)


def frames_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """Return the gap between a path made in another frame, expressed back, and the path made in the original frame.

    Args:
        scenario: the scenario.
        variant: one of `FRAMES`.
        name: name of the method.
    """
    part, begun = part_named(scenario.part), time.perf_counter()
    shown, start, goal, obstacles, tool = (
        part.shown, scenario.start, scenario.goal, scenario.obstacles, tool_of(part.name),
    )  # fmt: skip
    guide = guide_index(imitated_path(shown, goal), METHODS[name].guide)
    try:
        first = made(scenario, name, shown, start, goal, obstacles, tool, guide)
        if variant == "world":
            there = [Obstacle(each.shape, WORLD @ each.pose, name=each.name) for each in obstacles]
            other = made(scenario, name, shown.moved(WORLD), WORLD @ start, WORLD @ goal, there, tool, guide)
            other = other.moved(WORLD.inverse())
        elif variant == "recorded elsewhere":
            other = made(scenario, name, shown.moved(ELSEWHERE), start, goal, obstacles, tool, guide)
        else:
            held, index = _in_frame(tool, TOOL), guide if variant == "tool" else None
            other = made(scenario, name, shown.with_tool(TOOL), start @ TOOL, goal @ TOOL, obstacles, held, index)
            other = other.with_tool(TOOL.inverse())
    except (PlanFailed, NotFinite, NotUnit) as failure:
        return {"made": False, "reason": _reason(failure), "gap": None, "ms": _since(begun)}
    gap = max(metrics.curve_gap(other, first), metrics.curve_gap(first, other))
    return {"made": True, "reason": "", "gap": gap, "ms": _since(begun)}


def _in_frame(tool: np.ndarray, tcp_from_other: Pose) -> np.ndarray:
    """Return capsules (m, 7) of the tcp's frame in another frame that moves with the tcp."""
    back = tcp_from_other.inverse()
    ends = tool[:, : TOOL_CAPSULE.radius].reshape(-1, 3) @ back.rotation.T + back.position
    return np.column_stack([ends.reshape(-1, 6), tool[:, TOOL_CAPSULE.radius]])


def made(
    scenario: GeometricScenario,
    name: str,
    shown: PosePath,
    start: Pose,
    goal: Pose,
    obstacles: Sequence[Obstacle],
    tool: np.ndarray,
    guide: int | None = None,
) -> PosePath:
    """Return a method's path.

    Args:
        scenario: the scenario.
        name: name of the method.
        shown: the demonstrated path.
        start: start pose of the tcp.
        goal: goal pose of the tcp.
        obstacles: static obstacles.
        tool: (m, 7) capsules in the tcp's frame, see `Body.tool`; for free-flying tools.
        guide: index of the guiding pose in `shown`; None: by the method's fraction.

    Raises:
        PlanFailed: no path was found.
    """
    method = METHODS[name]
    settings = settings_of_method(name)
    if method.planned:
        plan = _planner(name, scenario.part).plan(shown, scenario.joints, goal, obstacles, seed=scenario.index)
        if not plan.success:
            raise PlanFailed(plan.reason, plan.detail)
        return PosePath(np.array([robot().arm.fk(q).dq for q in plan.joints]))
    return made_path(method.generator, shown, start, goal, obstacles, tool=tool, settings=settings, guide=guide)


@cache
def _planner(name: str, part: str) -> MotionPlanner:
    return motion_planner(METHODS[name].generator, robot().arm, holding(part), settings_of_method(name))


def settings_of_method(name: str) -> dict[str, Any]:
    """Return the settings of a method's path generator: those that know constraints must keep them, or say so."""
    keeping = {"keeping": "must"} if METHODS[name].generator == "screw" else {}
    return {"motion": {"guide": METHODS[name].guide}, **keeping}


def measured(scenario: GeometricScenario, name: str, shown: PosePath, aligned_from: float | None = None) -> Row:
    """Make a path and return its numbers; numbers that do not exist are None.

    Args:
        scenario: the scenario.
        name: name of the method.
        shown: the demonstrated path given to the method.
        aligned_from: fraction of the demonstration from which the path is compared with it; None: the method's guiding
            pose.
    """
    part, begun = part_named(scenario.part), time.perf_counter()
    try:
        path = made(scenario, name, shown, scenario.start, scenario.goal, scenario.obstacles, tool_of(part.name))
    except (PlanFailed, NotFinite, NotUnit) as failure:
        return {"made": False, "reason": _reason(failure), "reached": False, "clear": False, "ms": _since(begun)}
    taken = _since(begun)
    since = METHODS[name].guide if aligned_from is None else aligned_from
    clearance = ToolJudge(tool_of(part.name), scenario.obstacles).clearance_of(path)
    return {"made": True, "reason": "", **numbers(part, path, scenario.goal, since), "clear": clearance.clear,
            "clearance": clearance.least, "ms": taken}  # fmt: skip


def numbers(part: CarriedPart, path: PosePath, goal: Pose, aligned_from: float) -> Row:
    """Return the numbers of a path that do not depend on obstacles.

    Args:
        part: the carried part.
        path: the path.
        goal: goal pose of the tcp.
        aligned_from: fraction of the demonstration from which the path is compared with it.
    """
    distance, angle = metrics.ending(path, goal)
    turned = metrics.turning(part.shown)
    values = {
        "end_distance": distance,
        "end_angle": angle,
        "tilt": metrics.tilt(part, path),
        "tilt_excess": metrics.tilt(part, path) - part.shown_tilt,
        "rim_drift": metrics.rim_drift(part, path, goal),
        "way": metrics.path_length(path) / metrics.path_length(part.shown),
        "turning": metrics.turning(path) / turned if turned > LEAST_TURNING else math.nan,
        "jerk": metrics.jerk(path),
        "aligned": metrics.aligned_deviation(part, path, goal, aligned_from),
    }
    finite = {key: None if value is None or math.isnan(value) else value for key, value in values.items()}
    return {"reached": metrics.is_reached(distance, angle), **finite}


def _reason(failure: OneDemoError) -> str:
    """Return why there is no path: the planner's reason, or that its numbers diverged."""
    return failure.reason if isinstance(failure, PlanFailed) else "diverged"


def _since(begun: float) -> float:
    return 1e3 * (time.perf_counter() - begun)


class GeometricJobs:
    """Worker object of geometric runs.

    Kinds of jobs: "draw" (seed, indices) and "rows" (folder, track, variant, methods, indices).
    """

    def __init__(self) -> None:
        self._suite: GeometricSuite | None = None
        self._warm = False

    def do(self, job: dict[str, Any]) -> dict[str, Any]:
        """Return the answer to a job."""
        try:
            if job["kind"] == "draw":
                return {"drawn": [drawn(index, job["seed"]) for index in job["indices"]]}
            if job["kind"] == "rows":
                self._suite = self._suite or read_suite(Path(job["folder"]))
                assert self._suite
                chosen = [self._suite.scenarios[index] for index in job["indices"]]
                if not self._warm:  # so that no row's time includes compilation
                    rows_of(chosen[0], job["track"], job["variant"], job["methods"])
                    self._warm = True
                rows = [rows_of(each, job["track"], job["variant"], job["methods"]) for each in chosen]
                return {"rows": [row for each in rows for row in each]}
            return {}
        except OneDemoError as error:
            return {"refused": str(error), "key": ""}

    def close(self) -> None:
        """Release the scenarios."""
        self._suite = None


def key_of(row: Mapping[str, Any]) -> tuple[str, str, str, int]:
    """Return the identity of a row: track, variant, method and scenario index."""
    return row["track"], row["variant"], row["method"], row["index"]


def results_hash(rows: Iterable[Row]) -> str:
    """Return the sha256 of the rows without their times: equal for any number of workers."""
    return sha256_of([{key: value for key, value in row.items() if key != "ms"} for row in rows])


if __name__ == "__main__":
    main(GeometricJobs())
