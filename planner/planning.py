"""The kinematic plan: one demonstration, a start, a goal and obstacles in, joints for every tick out.

First the whole closed loop in one compiled call (`leg`). Where that does not arrive: other guiding poses, detours
with other biases and less margin, and at last a search in joint space for a posture from which the rest of the
demonstrated path can be followed. Every step of what comes back with success is proven clear of all obstacles for
the whole arm. Not in the paper, which plans for the end effector's point.
"""

from __future__ import annotations

import time
from collections.abc import Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from .arm import Arm
from .body import Body
from .chain import FRAME, forward_into
from .errors import BadOption
from .escape import ESCAPED, FREE, GOAL_IN_COLLISION, START_IN_COLLISION
from .joint_leg import JointSearchSettings, joint_leg
from .leg import CHANGED, DETOURS, FOLLOWED, FULL, IMITATED, LAST, TREE_ROWS, Buffers, buffers, leg
from .motions import MotionSettings
from .pose import Pose, PosePath
from .pursuit import ARRIVED
from .repet import REASONS, Corner, EscapeTree, RepetSettings
from .safety import SafetySettings
from .scene_work import Layout, SceneWork, checked_obstacles
from .shapes import Obstacle
from .workspace import bound

BIASES: tuple[Corner, ...] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, -0.5, 0.0))

WHY = {
    **REASONS,
    START_IN_COLLISION: "no room for a detour at the start",
    GOAL_IN_COLLISION: "no room for a detour at the goal",
}
"""Of an escape that was not found: start and goal have been seen to be clear before."""


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """How a leg is planned.

    Attributes:
        motion: imitation, controller and pursuit.
        repet: escape trees.
        safety: the layer that keeps the whole arm clear.
        search: the search in joint space; None for none.
        biases: what detours are tried for, one after the other; see `RepetSettings.bias`.
        tight: factor of the planning margin in the second half of the tries.
        spacing: screw length [m] between poses of a blend.
        max_seconds: longest motion.
        avoid: False: no detours and no search, the safety layer alone.
    """

    motion: MotionSettings = field(default_factory=MotionSettings)
    repet: RepetSettings = field(default_factory=RepetSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    search: JointSearchSettings | None = field(default_factory=JointSearchSettings)
    biases: tuple[Corner, ...] = BIASES
    tight: float = 0.7
    spacing: float = 0.01
    max_seconds: float = 30.0
    avoid: bool = True

    def __post_init__(self):
        if not 0.0 < self.tight <= 1.0:
            raise BadOption("tight", f"{self.tight} is not in (0, 1]")
        if not self.biases:
            raise BadOption("biases", "there must be at least one")
        for name in ("spacing", "max_seconds"):
            if not 0 < getattr(self, name) < 3600:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number below 3600")
        if self.repet.distance * self.tight < self.safety.distance:
            reason = f"{self.repet.distance} times {self.tight} is below the safety distance {self.safety.distance}"
            raise BadOption("repet.distance", reason)


class Plan(NamedTuple):
    """A planned leg.

    Attributes:
        joints: (t, dof) joints at every tick, from the start; only the start where nothing was found.
        dt: seconds between them.
        reason: "" if the plan arrives and every step of it is proven clear; else why there is none.
        how: "direct", "escape" or "joint search".
        imitated_poses: (n, 8) of the demonstration moved to the goal.
        path_poses: (m, 8) of what was followed: the imitated path behind the guiding pose, or a detour.
        tree_rows: of the last escape tree; none if none was grown.
        detours: number of them.
        margin: smallest joint margin on the way [rad].
        changed: ticks in which the safety layer changed the command.
        tries: closed loops that were tried.
        seconds: that planning took.
    """

    joints: np.ndarray
    dt: float
    reason: str
    how: str
    imitated_poses: np.ndarray
    path_poses: np.ndarray
    tree_rows: np.ndarray
    detours: int
    margin: float
    changed: int
    tries: int
    seconds: float

    @property
    def success(self) -> bool:
        """The plan arrives, and every step of it is proven clear."""
        return not self.reason

    @property
    def imitated(self) -> PosePath:
        """The demonstration moved to the goal."""
        return PosePath(self.imitated_poses)

    @property
    def path(self) -> PosePath:
        """What was followed: the imitated path behind the guiding pose, or a detour."""
        return PosePath(self.path_poses)

    @property
    def tree(self) -> EscapeTree | None:
        """The last escape tree, None if none was grown."""
        return EscapeTree.from_rows(self.tree_rows) if len(self.tree_rows) else None


class Problem(NamedTuple):
    """A leg to plan; see `Planner.plan`."""

    demonstrated: PosePath
    start: np.ndarray
    goal: Pose
    obstacles: tuple[Obstacle, ...] = ()
    seed: int = 0


class Planner:
    """Plans legs of one arm; keeps its arrays, so use one per thread.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `PlanSettings`.
    """

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings | None = None):
        self.arm, self.settings = arm, settings or PlanSettings()
        self.hold(body)
        motion = self.settings.motion
        self._work = bound(arm, motion.controller.packed(), motion.pursuit.packed())
        self._buffers: Buffers = buffers(self.settings.repet, arm.dof, round(self.settings.max_seconds / motion.dt))
        self._memory, self._wish, self._out = np.zeros(4), np.empty(arm.dof), np.empty(arm.dof)

    def hold(self, body: Body) -> None:
        """The body from now on: after something was grasped or released."""
        self.body = body
        self._layout = Layout(self.arm, body, self.settings.safety, self.settings.motion.dt)

    def plan(
        self,
        demonstrated: PosePath,
        start: ArrayLike,
        goal: Pose,
        obstacles: Sequence[Obstacle] = (),
        *,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        onward: PosePath | None = None,
        seed: int = 0,
    ) -> Plan:
        """Plan a leg.

        Args:
            demonstrated: the segment to imitate, any number of poses.
            start: (dof,) joints now.
            goal: where the tcp must end.
            obstacles: as they are now; they are taken to stand still.
            allowed: pairs of names (part of the body or held object, obstacle) that may touch.
            leaving: how to leave, from the pose at `start` on; None: blend at once.
            onward: the next leg's path: in a search, postures from which it can be followed are preferred.
            seed: of all random choices; the same seed gives the same plan.
        """
        begun = time.perf_counter()
        q = self.arm.checked(start)
        scene = SceneWork(self._layout, checked_obstacles(obstacles), self.settings.repet.distance, allowed)
        reason = self._unfit(scene, q, goal)
        if reason:
            return self._failed(reason, q, demonstrated, begun)
        lead = leaving.dqs.copy() if leaving is not None else self._pose(q)[None]
        best, escapes = "", []
        for fraction, bias, factor in self._attempts(escapes):
            status, pursuit, margin = self._leg(scene, demonstrated, goal, lead, q, fraction, bias, factor, seed)
            escapes.append(status)
            if pursuit == ARRIVED:
                # also where the tool is too close for a detour: the safety layer has proven every step
                how = "escape" if status == ESCAPED else "direct"
                return self._plan(how, margin, len(escapes), begun)
            best = best or WHY.get(status, "") or "ik_or_limit"
        found = None
        if self.settings.search is not None and self.settings.avoid:
            found = joint_leg(self.arm, scene, self._work, demonstrated, goal, q, self.settings, onward, seed)
        if found is None:
            return self._failed(best, q, demonstrated, begun, len(escapes))
        self._buffers.counts[DETOURS] = self._buffers.counts[TREE_ROWS] = 0
        plan = self._plan("joint search", found.margin, len(escapes), begun)
        return plan._replace(joints=found.joints, path_poses=found.path.dqs)

    def _pose(self, q: np.ndarray) -> np.ndarray:
        out = np.empty(8)
        forward_into(self.arm.chain, q, np.empty((self.arm.dof, FRAME)), out)
        return out

    def _unfit(self, scene: SceneWork, q: np.ndarray, goal: Pose) -> str:
        if self.arm.margin(q) < 0.0:
            return "start beyond a joint limit"
        if scene.room(q) < 0.0:
            return "start in collision"
        if scene.tool_room(goal) < 0.0:
            return "goal in collision"
        return ""

    def _attempts(self, escapes: list[int]) -> Iterator[tuple[float, Corner, float]]:
        """Guide, bias and margin factor of each closed loop that is tried, the likeliest first.

        Args:
            escapes: statuses of the tries so far: biases help where the arm could not follow a detour, not where
                there is none.
        """
        settings, (guide, later) = self.settings, (self.settings.motion.guide, self.settings.motion.max_guide)
        yield guide, settings.biases[0], 1.0
        if escapes[-1] in (FREE, ESCAPED):
            yield later, settings.biases[0], 1.0
        if not settings.avoid:
            return
        yield guide, settings.biases[0], settings.tight
        if escapes[-1] == ESCAPED:
            for bias in settings.biases[1:]:
                yield guide, bias, settings.tight

    def _leg(self, scene, demonstrated, goal, lead, q, fraction, bias, factor, seed):
        b, motion = self._buffers, self.settings.motion
        tool = scene.tool(factor)
        packed = self.settings.repet.packed() if bias == BIASES[0] else replace(self.settings.repet, bias=bias).packed()
        b.options[:] = packed
        b.options[22] = scene.widest(factor)
        if not self.settings.avoid:
            b.options[24] = 0.0  # no rounds
        b.state[0] = float(seed % 2147483646) + 1.0
        return leg(
            self._work, scene.robot, tool, demonstrated.dqs, goal.dq, lead, q.copy(), fraction, self.settings.spacing,
            motion.dt, b, self._memory, self._wish, self._out,
        )  # fmt: skip

    def _plan(self, how: str, margin: float, tries: int, begun: float) -> Plan:
        b, counts = self._buffers, self._buffers.counts
        rows = int(counts[TREE_ROWS])
        return Plan(
            b.trace[: counts[LAST] + 1].copy(),
            self.settings.motion.dt,
            "",
            how,
            b.imitated[: counts[IMITATED]].copy(),
            b.followed[: counts[FOLLOWED]].copy(),
            b.tree[:rows].copy(),
            int(counts[DETOURS]),
            float(margin),
            int(counts[CHANGED]),
            tries,
            time.perf_counter() - begun,
        )

    def _failed(self, reason: str, q: np.ndarray, demonstrated: PosePath, begun: float, tries: int = 0) -> Plan:
        b, counts = self._buffers, self._buffers.counts if tries else np.zeros(8, dtype=np.int64)
        path = b.path[: counts[FULL]].copy() if counts[FULL] else demonstrated.dqs
        seconds, dt = time.perf_counter() - begun, self.settings.motion.dt
        tree = b.tree[: counts[TREE_ROWS]].copy()
        return Plan(q[None], dt, reason, "", demonstrated.dqs, path, tree, 0, -np.inf, 0, tries, seconds)


def plan(
    demonstrated: PosePath,
    start: ArrayLike,
    goal: Pose,
    obstacles: Sequence[Obstacle],
    arm: Arm,
    body: Body,
    settings: PlanSettings | None = None,
    seed: int = 0,
) -> Plan:
    """Plan one leg; see `Planner.plan`, which is faster for several."""
    return Planner(arm, body, settings).plan(demonstrated, start, goal, obstacles, seed=seed)


def plan_batch(
    problems: Sequence[Problem], arm: Arm, body: Body, settings: PlanSettings | None = None, *, workers: int = 2
) -> list[Plan]:
    """Plans of many problems, in their order, on several cores; the same as one by one.

    Args:
        problems: the legs.
        arm: the arm.
        body: its capsules.
        settings: see `PlanSettings`.
        workers: threads; the compiled loops let go of the interpreter. Each takes the next problem when it is done
            with its last: a few hard ones take longer than all others together.
    """
    if not 1 <= workers <= 256:
        raise BadOption("workers", f"{workers} is not from 1 to 256")

    left = iter(enumerate(problems))  # taking the next of it is one step of the interpreter

    def run(planner: Planner) -> dict[int, Plan]:
        return {k: planner.plan(p.demonstrated, p.start, p.goal, p.obstacles, seed=p.seed) for k, p in left}

    planners = [Planner(arm, body, settings) for _ in range(min(workers, len(problems)))]
    with ThreadPoolExecutor(workers) as pool:
        found = {k: plan for plans in pool.map(run, planners) for k, plan in plans.items()}
    return [found[k] for k in range(len(problems))]
