"""The kinematic plan: one demonstration, a start, a goal and obstacles in, joints for every tick out.

First the whole closed loop in one compiled call (`plan_closed_loop`). Where that does not arrive: other guiding poses,
detours with other biases and less margin, and at last a search in joint space for a posture from which the rest of the
demonstrated path can be followed. Every step of what comes back with success is proven clear of all obstacles for
the whole arm. Not in the paper, which plans for the end effector's point.
"""

from __future__ import annotations

import math
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..control.arm_arrays import arm_arrays
from ..control.pursuit import ARRIVED
from ..errors import BadOption
from ..escape.detour import ESCAPED, GOAL_IN_COLLISION, NO_ESCAPE, NODE_LIMIT, START_IN_COLLISION
from ..escape.escape_tree import CANDIDATES, ROUNDS, WIDEST
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle
from ..imitation.tsia import guide_index, imitated_path
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.kinematics import FRAME, forward_into
from .attempts import Attempt, attempts
from .closed_loop_motion import (
    CHANGED,
    DETOURS,
    FOLLOWED,
    FULL,
    GUIDE,
    IMITATED,
    LAST,
    TREE_ROWS,
    Buffers,
    buffers,
    plan_closed_loop,
)
from .joint_space_motion import NextMotionCheck, path_deviation, plan_joint_space
from .plan import WHY, NextMotion, Plan, PlanRequest, Problem
from .planning_scene import PlanningScene, SceneTemplate, checked_obstacles
from .settings import PlanSettings


class _Run(NamedTuple):
    """One call of `Planner.plan`: what was asked, the arm among obstacles, demonstration, joints, what comes next."""

    request: PlanRequest
    scene: PlanningScene
    demonstrated: PosePath
    q: np.ndarray
    after: NextMotionCheck | None


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
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._buffers: Buffers = buffers(self.settings.repet, arm.dof, round(self.settings.max_seconds / motion.dt))
        self._pursuit_state, self._wish, self._out = np.zeros(4), np.empty(arm.dof), np.empty(arm.dof)

    def hold(self, body: Body) -> None:
        """The body from now on: after something was grasped or released."""
        self.body = body
        settings = self.settings
        self._template = SceneTemplate(self.arm, body, settings.safety, settings.motion.dt, guard=settings.guard)

    def plan(
        self,
        demonstrated: PosePath,
        start: ArrayLike,
        goal: Pose,
        obstacles: Sequence[Obstacle] = (),
        *,
        allowed: Sequence[tuple[str, str]] = (),
        leaving: PosePath | None = None,
        next_motion: NextMotion | None = None,
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
            next_motion: what comes next; see `NextMotion`.
            seed: of all random choices; the same seed gives the same plan.
        """
        begun = time.perf_counter()
        q = self.arm.checked(start)
        scene = PlanningScene(self._template, checked_obstacles(obstacles), self.settings.repet.distance, allowed)
        request = PlanRequest(self.arm, self.body, goal, tuple(obstacles), tuple(allowed), self.settings, demonstrated)
        run = _Run(request, scene, demonstrated, q, self._after(scene, request, next_motion))
        reason, detail = self._unfit(scene, q, goal)
        if reason:
            return self._failed(run, reason, detail)
        best, tries = self._followed(run, leaving.dqs.copy() if leaving is not None else self._pose(q)[None], seed)
        if not best.success or best.end_margin < self.settings.end_margin or not best.next_feasible:
            best = self._searched(run, best, seed)
        return best._replace(tries=tries, seconds=time.perf_counter() - begun)

    def _followed(self, run: _Run, lead: np.ndarray, seed: int) -> tuple[Plan, int]:
        """The first good plan of the closed loops, else the best of a few, else why there is none; and the tries."""
        escapes, best, extra, failed = [], None, self.settings.effort, None
        for attempt in attempts(self.settings, escapes):
            if best is not None:
                if extra == 0:
                    break
                extra -= 1
            status, pursuit, margin = self._closed_loop(run, lead, attempt, seed)
            escapes.append(status)
            if pursuit == ARRIVED and self._is_straight():
                # also where the tool is too close for a detour: the safety layer has proven every step
                found = self._plan(run, "escape" if status == ESCAPED else "direct", margin, attempt)
                found = found._replace(next_feasible=self._next_is_feasible(run, found.joints[-1]))
                if self._is_good(found) or self.settings.effort == 0:
                    return found, len(escapes)
                best = found if best is None else _better(best, found)
            elif failed is None:
                reason = WHY.get(status, "") or "ik_or_limit"
                failed = reason, self._detail(run, status, attempt.factor)
        if best is None:
            assert failed is not None
            best = self._failed(run, *failed, tried=True)
        return best, len(escapes)

    def _searched(self, run: _Run, best: Plan, seed: int) -> Plan:
        """The better of a plan, which may be none, and one of a search in joint space."""
        settings = self.settings
        if settings.search is None or not settings.avoid or (best.success and settings.effort == 0):
            return best
        if best.success and best.next_feasible:
            rounds = min(settings.search.rounds, settings.effort)
            settings = replace(settings, search=replace(settings.search, rounds=rounds))
        found = plan_joint_space(
            self.arm, run.scene, self._work, run.demonstrated, run.request.goal, run.q, settings, run.after, seed
        )
        if found is None:
            return best
        imitated = imitated_path(run.demonstrated, run.request.goal)
        plan = Plan(
            found.joints, settings.motion.dt, "", "joint search", imitated.dqs, found.path.dqs, self._buffers.tree[:0],
            0, found.margin, 0, 0, 0.0, run.request, "", found.guide,
            _imitated_share(imitated.dqs, found.path.dqs, settings.motion.guide),
            next_feasible=found.next_feasible or run.after is None or not run.after.required,
        )  # fmt: skip
        return _better(best, plan) if best.success else plan

    def _is_good(self, plan: Plan) -> bool:
        settings = self.settings
        return (
            plan.imitated_share >= settings.min_imitated_share
            and plan.end_margin >= settings.end_margin
            and plan.next_feasible
        )

    def _is_straight(self) -> bool:
        """True if the tool has kept as near to what it has followed as it must."""
        b, counts, max_deviation = self._buffers, self._buffers.counts, self.settings.max_deviation
        if math.isinf(max_deviation):
            return True
        joints = b.trace[: counts[LAST] + 1]
        path = np.vstack([self._pose(joints[0]), b.followed[: counts[FOLLOWED]]])
        return path_deviation(self.arm, joints, path) <= max_deviation

    def _after(
        self, scene: PlanningScene, request: PlanRequest, next_motion: NextMotion | None
    ) -> NextMotionCheck | None:
        if next_motion is None:
            return None
        if next_motion.required:
            scene = PlanningScene(self._template, request.obstacles, self.settings.repet.distance, next_motion.allowed)
        return NextMotionCheck(scene, next_motion.path, next_motion.required)

    def _next_is_feasible(self, run: _Run, q: np.ndarray) -> bool:
        """True if what must come next can be done from joints q."""
        return (
            run.after is None or not run.after.required or run.after.is_feasible(self.arm, self._work, q, self.settings)
        )

    def _pose(self, q: np.ndarray) -> np.ndarray:
        out = np.empty(8)
        forward_into(self.arm.chain, q, np.empty((self.arm.dof, FRAME)), out)
        return out

    def _unfit(self, scene: PlanningScene, q: np.ndarray, goal: Pose) -> tuple[str, str]:
        """Why start or goal cannot be, and what in this case; "" if they can."""
        if self.arm.margin(q) < 0.0:
            margins = np.minimum(q - self.arm.lower, self.arm.upper - q)
            joint = int(np.argmin(margins))
            return "start beyond a joint limit", f"{self.arm.joint_names[joint]} by {-margins[joint]:.3f} rad"
        if self.settings.guard and scene.slack(q) < 0.0:
            return "start in collision", str(scene.tightest(q))
        # what neither plans round anything nor is guarded does not look
        if (self.settings.guard or self.settings.avoid) and scene.tool_slack(goal) < 0.0:
            return "goal in collision", str(scene.tightest_of_tool(goal))
        return "", ""

    def _detail(self, run: _Run, status: int, factor: float) -> str:
        """What is to be said of an escape that was not found."""
        rows, repet = int(self._buffers.counts[TREE_ROWS]), self.settings.repet
        if status == START_IN_COLLISION:
            return str(run.scene.tightest_of_tool(Pose(self._pose(run.q)), factor))
        if status == GOAL_IN_COLLISION:
            return str(run.scene.tightest_of_tool(run.request.goal, factor))
        if status == NODE_LIMIT:
            return f"a tree had {repet.nodes} nodes, see repet.nodes"
        return f"{rows} nodes in the last of {repet.retries + 1} trees" if status == NO_ESCAPE else ""

    def _closed_loop(self, run: _Run, lead: np.ndarray, attempt: Attempt, seed: int) -> tuple[int, int, float]:
        b, motion, repet = self._buffers, self.settings.motion, self.settings.repet
        tool = run.scene.tool(attempt.factor)
        b.options[:] = (repet if attempt.bias == repet.bias else replace(repet, bias=attempt.bias)).packed()
        b.options[WIDEST] = run.scene.widest(attempt.factor)
        if attempt.early:
            b.options[CANDIDATES] = 1.0
        if not self.settings.avoid:
            b.options[ROUNDS] = 0.0
        b.state[0] = float(seed % 2147483646) + 1.0
        return plan_closed_loop(
            self._work, run.scene.robot, tool, run.demonstrated.dqs, run.request.goal.dq, lead, run.q.copy(),
            attempt.guide, self.settings.spacing, motion.dt, b, self._pursuit_state, self._wish, self._out,
        )  # fmt: skip

    def _plan(self, run: _Run, how: str, margin: float, attempt: Attempt) -> Plan:
        b, counts, guide = self._buffers, self._buffers.counts, self.settings.motion.guide
        imitated, path = b.imitated[: counts[IMITATED]].copy(), b.followed[: counts[FOLLOWED]].copy()
        whole = how == "direct" and attempt.guide == guide
        return Plan(
            b.trace[: counts[LAST] + 1].copy(),
            self.settings.motion.dt,
            "",
            how,
            imitated,
            path,
            b.tree[: counts[TREE_ROWS]].copy(),
            int(counts[DETOURS]),
            float(margin),
            int(counts[CHANGED]),
            0,
            0.0,
            run.request,
            guide=int(counts[GUIDE]),
            imitated_share=1.0 if whole else _imitated_share(imitated, path, guide),
        )

    def _failed(self, run: _Run, reason: str, detail: str, *, tried: bool = False) -> Plan:
        b, counts = self._buffers, self._buffers.counts if tried else np.zeros(8, dtype=np.int64)
        path = b.path[: counts[FULL]].copy() if counts[FULL] else run.demonstrated.dqs
        tree, dt = b.tree[: counts[TREE_ROWS]].copy(), self.settings.motion.dt
        return Plan(
            run.q[None], dt, reason, "", run.demonstrated.dqs, path, tree, 0, -np.inf, 0, 0, 0.0, run.request, detail,
            imitated_share=0.0,
        )  # fmt: skip


def _imitated_share(imitated: np.ndarray, path: np.ndarray, guide: float) -> float:
    """Screw length of the imitated path's (n, 8) edges that are in a path (m, 8), over that behind the guiding pose.

    Bit by bit: what is followed is copied.
    """
    if len(imitated) < 2:
        return 1.0
    rows = {row.tobytes() for row in path}
    there = np.array([row.tobytes() in rows for row in imitated])
    whole = PosePath(imitated)
    lengths = whole.lengths()
    wanted = lengths[-1] - lengths[guide_index(whole, guide)]
    return float(np.diff(lengths) @ (there[1:] & there[:-1]) / wanted) if wanted > 0.0 else 1.0


def _better(one: Plan, other: Plan) -> Plan:
    """The plan that can go on, that keeps more of the demonstration; of those that keep as much, the freer end."""
    return max((one, other), key=lambda plan: (plan.next_feasible, round(plan.imitated_share, 1), plan.end_margin))


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
