"""What a worker of the geometric tier does: scenarios drawn, paths made and measured.

Three tracks: `paths`, the levels; `sparse`, the demonstration thinned to some key poses; `frames`, the same path in
another tool frame or another world, expressed back. A row depends on nothing but its scenario, track, variant and
method; only its last number, the time, differs from run to run.
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
from ...planner.errors import NotFinite, NotUnit, OneDemoError, PlanFailed
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Obstacle
from ...planner.imitation.segmentation import key_poses
from ...planner.imitation.tsia import GUIDE_START, guide_index, imitated_path, screw_path
from ..atomic_files import sha256_of
from ..workers.worker_process import main
from . import metrics
from .clearance import ToolJudge
from .parts import CarriedPart, holding, part_named, robot, tool_of
from .suite import GeometricScenario, GeometricSuite, drawn, read_suite

SHIPPED_GUIDE = 0.5
COMMON = 0.3
"""Fraction of the demonstration behind which all methods are compared with it when it is thinned: key poses move the
guiding pose a little."""
LEAST_TURNING = 0.1
"""Rotation [rad] of a demonstration below which a path's is not divided by it."""
KEY_POSES = (600, 60, 24, 12, 6, 4)
TOOL = Pose.from_position_quaternion(np.full(3, 0.1 / math.sqrt(3.0)), [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)])
"""The other tool frame in the tcp: 10 cm away, turned by 90 degrees."""
WORLD = Pose.from_position_quaternion([0.7, -0.4, 0.3], [0.5, 0.1, -0.7, 0.5])
"""The other world: nothing of it is along the old one's axes."""
FRAMES = ("tool", "tool, guide by length", "world", "recorded elsewhere")
"""What is changed: the tool frame, with the same guiding pose or with the one that its own length gives; all of the
world; or the world of the demonstration alone, as if it had been recorded on another table."""
ELSEWHERE = Pose.from_yaw([0.3, 0.5, 0.0], np.deg2rad(70.0))


class Method(NamedTuple):
    """A row of the tables.

    Attributes:
        generator: the policy whose path maker it is.
        guide: fraction at which its blend ends.
        join: how it reads the way between key poses.
        planned: the path is that of an arm whose motion was planned; else that of a tool that flies freely.
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
"""By name: `screw` is the whole method, `repet` imitation with escape trees alone; joins matter where key poses are
few."""
TRACKS = {
    "paths": tuple(name for name in METHODS if name != "dmp-goal, screws"),
    "sparse": ("tsia", "decoupled", "replay", "dmp-goal", "dmp-goal, screws", "dmp-world"),
    "frames": ("repet", "tsia", "decoupled", "replay", "dmp-goal", "dmp-world", "potential"),
}
"""The methods of each track: where two must give the same path, one of them."""
Row = dict[str, Any]


def rows_of(scenario: GeometricScenario, track: str, variant: str, methods: Sequence[str]) -> list[Row]:
    """A row for each method."""
    one = {"paths": path_row, "sparse": sparse_row, "frames": frames_row}[track]
    head = {"track": track, "variant": variant, "index": scenario.index, "part": scenario.part, "level": scenario.level}
    return [{**head, "method": name, **one(scenario, variant, name)} for name in methods]


def path_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """The numbers of a method's path in a scenario."""
    return measured(scenario, name, part_named(scenario.part).shown)


def sparse_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """The numbers of a path that was made from so many key poses, against the whole demonstration."""
    part = part_named(scenario.part)
    keys = key_poses(part.shown, int(variant))
    return measured(scenario, name, filled(keys, METHODS[name].join), aligned_from=COMMON)


def frames_row(scenario: GeometricScenario, variant: str, name: str) -> Row:
    """How far a path made in another frame, expressed back, is from the path made in the first."""
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
    """Capsules (m, 7) of the tcp's frame in another frame that moves with it."""
    back = tcp_from_other.inverse()
    ends = tool[:, :6].reshape(-1, 3) @ back.rotation.T + back.position
    return np.column_stack([ends.reshape(-1, 6), tool[:, 6]])


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
    """A method's path.

    Raises:
        PlanFailed: it finds none.
    """
    method = METHODS[name]
    settings = {"motion": {"guide": method.guide}}
    if method.planned:
        plan = _planner(name, scenario.part).plan(shown, scenario.joints, goal, obstacles, seed=scenario.index)
        if not plan.success:
            raise PlanFailed(plan.reason, plan.detail)
        return PosePath(np.array([robot().arm.fk(q).dq for q in plan.joints]))
    return made_path(method.generator, shown, start, goal, obstacles, tool=tool, settings=settings, guide=guide)


@cache
def _planner(name: str, part: str) -> MotionPlanner:
    method = METHODS[name]
    return motion_planner(method.generator, robot().arm, holding(part), {"motion": {"guide": method.guide}})


def measured(scenario: GeometricScenario, name: str, shown: PosePath, aligned_from: float | None = None) -> Row:
    """Make a path and take its numbers; what there is none of is None.

    Args:
        scenario: where.
        name: the method.
        shown: the demonstration as the method gets it.
        aligned_from: fraction of the demonstration from which on it is compared; None: the method's guiding pose.
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
    """The numbers of a path that do not depend on obstacles."""
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
    """Why there is no path: there is none, or its numbers ran away."""
    return failure.reason if isinstance(failure, PlanFailed) else "diverged"


def _since(begun: float) -> float:
    return 1e3 * (time.perf_counter() - begun)


class GeometricJobs:
    """Does the jobs of geometric runs.

    Its jobs are "draw" (seed, indices) and "rows" (folder, track, variant, methods, indices).
    """

    def __init__(self) -> None:
        self._suite: GeometricSuite | None = None
        self._warm = False

    def do(self, job: dict[str, Any]) -> dict[str, Any]:
        """The answer to a job."""
        try:
            if job["kind"] == "draw":
                return {"drawn": [drawn(index, job["seed"]) for index in job["indices"]]}
            if job["kind"] == "rows":
                self._suite = self._suite or read_suite(Path(job["folder"]))
                assert self._suite
                chosen = [self._suite.scenarios[index] for index in job["indices"]]
                if not self._warm:  # so that no row's time is that of compiling
                    rows_of(chosen[0], job["track"], job["variant"], job["methods"])
                    self._warm = True
                rows = [rows_of(each, job["track"], job["variant"], job["methods"]) for each in chosen]
                return {"rows": [row for each in rows for row in each]}
            return {}
        except OneDemoError as error:
            return {"refused": str(error), "key": ""}

    def close(self) -> None:
        """Forget the scenarios."""
        self._suite = None


def key_of(row: Mapping[str, Any]) -> tuple[str, str, str, int]:
    """What a row is told from others by."""
    return row["track"], row["variant"], row["method"], row["index"]


def results_hash(rows: Iterable[Row]) -> str:
    """sha256 of the rows without their times: the same for any number of workers."""
    return sha256_of([{key: value for key, value in row.items() if key != "ms"} for row in rows])


if __name__ == "__main__":
    main(GeometricJobs())
