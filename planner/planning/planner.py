"""The kinematic planner: one demonstration, a start, a goal and obstacles in, joints for every tick out.

First the whole closed loop (`closed_loop`). Where that does not arrive: other guiding poses,
detours with other biases and less margin, and at last a search in joint space for a posture from which the rest of the
demonstrated path can be followed. Every step of a successful plan is proven clear of all obstacles for the whole arm.
Not in the paper, which plans for the end effector's point.
"""

from __future__ import annotations

import time
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from ..arrays import checked_kind, checked_settings
from ..constraints.violation import violation_of
from ..control.arm_arrays import arm_arrays
from ..control.pursuit import ARRIVED
from ..control.reachability import why_not_reached
from ..escape.detour import ESCAPED
from ..escape.repet import Corner
from ..escape.tree_arrays import OPTION
from ..geometry.pose import Pose, PosePath
from ..imitation.constraint import Constraint
from ..imitation.tsia import imitated_path, imitated_share
from ..ranges import ticks_of
from ..resumable import SCENE, Resumable
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.kinematics import FRAME, forward_into
from .attempts import NOT_KEPT, NOTHING_KEPT, Attempt, attempts, better, escape_detail, is_straight
from .closed_loop_motion import COUNT, Buffers, ClosedLoop, buffers, closed_loop
from .constrained_search import ConstrainedSearch
from .joint_goal import line_to, plan_to_joints, tool_path
from .joint_space_motion import (
    DEEP_CONTACT,
    IK_OR_LIMIT,
    JointSpaceMotion,
    NextMotionCheck,
    SearchFailure,
    plan_joint_space,
)
from .plan import WHY, MotionPlanner, Plan, PlanRequest
from .planning_scene import PlanningScene, scene_template
from .requests import check_of, checked_request, constraint_of, keeping_of, reduced_request, unfit
from .settings import PlanSettings


class _Run(NamedTuple):
    """An answer in the making: request, the arm among obstacles, its joints, its goal, the check of the next motion.

    And what is to be kept; None: nothing.
    """

    request: PlanRequest
    scene: PlanningScene
    q: np.ndarray
    goal: Pose
    check: NextMotionCheck | None
    constraint: Constraint | None


class Planner(MotionPlanner):
    """Plans motions of one arm; its arrays are used again: one planner per thread, one motion at a time.

    Args:
        arm: the arm.
        body: its capsules, held object included.
        settings: see `PlanSettings`.
    """

    def __init__(self, arm: Arm, body: Body, settings: PlanSettings | None = None):
        self.arm, self.settings = checked_kind("arm", arm, Arm), checked_settings(PlanSettings, settings)
        self.hold(body)
        motion = self.settings.motion
        self._work = arm_arrays(arm, motion.controller.packed(), motion.pursuit.packed())
        self._options: dict[Corner, np.ndarray] = {}
        self._buffers = self._room(2)

    def hold(self, body: Body) -> None:
        """Use another body from now on: after an object was grasped or released.

        Raises:
            WrongType, BadModel: no body, or one of another arm.
        """
        self.body, settings = checked_kind("body", body, Body), self.settings
        self._template = scene_template(self.arm, body, settings.safety, settings.motion.dt, settings.guard)

    def answering(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion in slices; a failed plan says why.

        Raises:
            WrongType, BadShape, NotFinite, BadOption: a part of the request cannot be used, see `checked_request`.
            UnknownName: `allowed` names a part or an obstacle that does not exist.
        """
        begun = time.perf_counter()
        asked = checked_request(request, self.arm)
        request, reduction = reduced_request(asked, max(self.settings.repet.longest, 2))
        yield SCENE
        plan = yield from self._answer(request)
        return plan._replace(request=asked, reduction=reduction, seconds=time.perf_counter() - begun)

    def _answer(self, request: PlanRequest) -> Resumable[Plan]:
        """Plan a motion along paths that the work arrays have room for."""
        q = self.arm.checked(request.start)
        scene = PlanningScene(self._template, request.obstacles, self.settings.repet.distance, request.allowed)
        to = request.goal
        pose = to if isinstance(to, Pose) else self.arm.fk(to)
        constraint = constraint_of(request, self.settings, Pose(self._pose(q)), holds=bool(self.body.held))
        run = _Run(request, scene, q, pose, check_of(self._template, scene, request, self.settings), constraint)
        reason, detail = unfit(self.arm, scene, request, self.settings)
        if reason:
            return self._failed(run, reason, detail)
        leaving = request.leaving
        lead = leaving.dqs.copy() if leaving is not None else self._pose(q)[None]
        self._make_room(len(lead) + len(request.demonstrated))
        if not isinstance(to, Pose):
            plan = yield from self._to_joints(run, np.asarray(to), lead)
            return plan._replace(tries=1)
        best, tries = yield from self._followed(run, lead, request.seed)
        if not (best.success and best.next_feasible and best.end_margin >= self.settings.end_margin and best.keeps_all):
            best = yield from self._searched(run, best, request.seed)
        if best.success and not best.keeps:
            best = self._failed(run, NOTHING_KEPT, f"found was: {best.how}", tried=True)
        if best.success and not best.violation.kept and keeping_of(request, self.settings) == "must":
            best = self._failed(run, NOT_KEPT, best.violation.detail, tried=True)._replace(violation=best.violation)
        if best.reason == IK_OR_LIMIT and not best.detail:
            best = best._replace(detail=why_not_reached(self.arm, pose, q))
        return best._replace(tries=tries)

    def _make_room(self, given: int) -> None:
        """Grow the work arrays if a number of given poses needs more."""
        if given + self.settings.repet.longest > len(self._buffers.path):
            self._buffers = self._room(given)

    def _room(self, given: int) -> Buffers:
        """Return work arrays with room for a number of given poses."""
        settings = self.settings
        return buffers(settings.repet, self.arm.dof, ticks_of(settings.max_seconds, settings.motion.dt), given)

    def _followed(self, run: _Run, lead: np.ndarray, seed: int) -> Resumable[tuple[Plan, int]]:
        """Return the first good plan of the closed loops, else the best of a few, else a failed one; and the tries."""
        escapes, best, extra, failed = [], None, self.settings.effort, None
        for attempt in attempts(self.settings, escapes):
            if best is not None:
                if extra == 0:
                    break
                extra -= 1
            status, pursuit, margin = yield from self._closed_loop(run, lead, attempt, seed)
            escapes.append(status)
            trace = self._buffers.trace[: self._buffers.counts[COUNT.last] + 1]
            arrived = pursuit == ARRIVED and is_straight(self.arm, self._buffers, self.settings.max_deviation)
            if arrived and run.scene.keeps_contacts(trace):
                # also where the tool is too close for a detour: the safety layer has proven every step
                found = self._plan(run, "escape" if status == ESCAPED else "direct", margin, attempt)
                found = found._replace(next_feasible=(yield from self._next_is_feasible(run, found.joints[-1])))
                if self._is_good(found) or (self.settings.effort == 0 and found.violation.kept):
                    return found, len(escapes)
                best = found if best is None else better(best, found)
            elif failed is None:
                rows, repet = int(self._buffers.counts[COUNT.tree_rows]), self.settings.repet
                why = "the safety layer leads the tool off the path"
                if pursuit != ARRIVED:
                    why = escape_detail(status, self.arm, run.scene, run.goal, trace, attempt.factor, rows, repet)
                failed = (DEEP_CONTACT, "") if arrived else (WHY.get(status, "") or IK_OR_LIMIT, why)
        if best is None:
            assert failed is not None
            best = self._failed(run, *failed, tried=True)
        return best, len(escapes)

    def _searched(self, run: _Run, best: Plan, seed: int) -> Resumable[Plan]:
        """Return the better of the given plan and a joint-space plan; without either, why the search failed."""
        settings = self.settings
        if settings.search is None or (best.success and best.keeps_all and settings.effort == 0):
            return best
        if run.constraint is not None:
            kept = yield from ConstrainedSearch(
                self.arm, run.scene, self._work, run.request.demonstrated, run.goal, run.q, run.constraint, settings,
                run.check, seed,
            ).run()  # fmt: skip
            if not isinstance(kept, SearchFailure):
                plan = self._through_joints(run, kept)
                best = better(best, plan) if best.success else plan
            elif not best.success and keeping_of(run.request, settings) == "must":
                return best._replace(reason=kept.reason, detail=kept.detail)
            if best.success:
                return best
        if best.success and best.next_feasible and best.keeps:
            rounds = min(settings.search.rounds, settings.effort)
            settings = replace(settings, search=replace(settings.search, rounds=rounds))
        found = yield from plan_joint_space(
            self.arm,
            run.scene,
            self._work,
            run.request.demonstrated,
            run.goal,
            run.q,
            settings,
            run.check,
            seed,
            must_keep=run.request.must_keep,
        )
        if isinstance(found, SearchFailure):
            return best if best.success else best._replace(reason=found.reason, detail=found.detail)
        plan = self._through_joints(run, found)
        return better(best, plan) if best.success else plan

    def _through_joints(self, run: _Run, found: JointSpaceMotion) -> Plan:
        """Return the plan of a motion found by a search."""
        imitated, settings = imitated_path(run.request.demonstrated, run.goal), self.settings
        return self._made(
            run,
            joints=found.joints,
            how="joint search",
            imitated_poses=imitated.dqs,
            path_poses=found.path.dqs,
            margin=found.margin,
            guide=found.guide,
            imitated_share=imitated_share(imitated.dqs, found.path.dqs, settings.motion.guide),
            next_feasible=found.next_feasible or run.check is None or not run.check.required,
        )

    def _to_joints(self, run: _Run, goal: np.ndarray, lead: np.ndarray) -> Resumable[Plan]:
        """Return a plan to goal joints: along the demonstration if it ends beside them, else by a search."""
        settings, seed = self.settings, run.request.seed
        attempt = Attempt(settings.motion.guide, settings.biases[0], detours=False)
        _, pursuit, margin = yield from self._closed_loop(run, lead, attempt, seed)
        if pursuit == ARRIVED and is_straight(self.arm, self._buffers, self.settings.max_deviation):
            found = self._plan(run, "direct", margin, attempt)
            rest = line_to(self.arm, run.scene, found.joints[-1], goal, settings)
            if rest is not None:
                found = found._replace(joints=np.vstack([found.joints, rest[1:]]))
                return (yield from self._ended(run, found))
        searches = settings.search.to_joints if settings.search is not None else 0
        joints = None
        if searches:
            joints = yield from plan_to_joints(self.arm, run.scene, run.q, goal, settings, seed)
        if joints is None:
            return self._failed(run, "no path to the goal joints", f"{searches} searches in joint space")
        plan = self._made(
            run,
            joints=joints,
            how="joint search",
            imitated_poses=imitated_path(run.request.demonstrated, run.goal).dqs,
            path_poses=tool_path(self.arm, joints),
            margin=0.0,
            imitated_share=0.0,
        )
        return (yield from self._ended(run, plan))

    def _ended(self, run: _Run, plan: Plan) -> Resumable[Plan]:
        """Return the plan with its joint margin, and whether the next motion is possible from its end."""
        margins = np.minimum(plan.joints - self.arm.lower, self.arm.upper - plan.joints)
        feasible = yield from self._next_is_feasible(run, plan.joints[-1])
        return plan._replace(margin=float(margins.min()), next_feasible=feasible)

    def _is_good(self, plan: Plan) -> bool:
        share, margin = self.settings.min_imitated_share, self.settings.end_margin
        good = plan.imitated_share >= share and plan.end_margin >= margin
        return good and plan.next_feasible and plan.violation.kept

    def _next_is_feasible(self, run: _Run, q: np.ndarray) -> Resumable[bool]:
        """True if a required next motion can be followed from joints q."""
        if run.check is None or not run.check.required:
            return True
        return (yield from run.check.is_feasible(self.arm, self._work, q, self.settings))

    def _pose(self, q: np.ndarray) -> np.ndarray:
        out = np.empty(8)
        forward_into(self.arm.chain, q, np.empty((self.arm.dof, FRAME.width)), out)
        return out

    def _closed_loop(self, run: _Run, lead: np.ndarray, attempt: Attempt, seed: int) -> Resumable[ClosedLoop]:
        b, motion, repet = self._buffers, self.settings.motion, self.settings.repet
        tool = run.scene.tool(attempt.factor)
        if attempt.bias not in self._options:
            self._options[attempt.bias] = replace(repet, bias=attempt.bias).packed()
        b.options[:] = self._options[attempt.bias]
        b.options[OPTION.largest_margin] = run.scene.widest(attempt.factor)
        if attempt.early:
            b.options[OPTION.candidates] = 1.0
        if run.constraint is not None:
            b.options[OPTION.guided] = run.constraint.count - run.constraint.guided
        if not (self.settings.trees and attempt.detours):
            b.options[OPTION.rounds] = 0.0
        b.state[0] = float(seed % 2147483646) + 1.0
        return closed_loop(
            self._work, run.scene.robot, tool, run.request.demonstrated.dqs, run.goal.dq, lead, run.q,
            attempt.guide, self.settings.spacing, motion.dt, b,
        )  # fmt: skip

    def _plan(self, run: _Run, how: str, margin: float, attempt: Attempt) -> Plan:
        b, counts, guide = self._buffers, self._buffers.counts, self.settings.motion.guide
        imitated, path = b.imitated[: counts[COUNT.imitated]].copy(), b.followed[: counts[COUNT.followed]].copy()
        whole = how == "direct" and attempt.guide == guide
        return self._made(
            run,
            joints=b.trace[: counts[COUNT.last] + 1].copy(),
            how=how,
            imitated_poses=imitated,
            path_poses=path,
            tree_rows=b.tree[: counts[COUNT.tree_rows]].copy(),
            detours=int(counts[COUNT.detours]),
            margin=float(margin),
            changed=int(counts[COUNT.changed]),
            guide=int(counts[COUNT.guide]),
            imitated_share=1.0 if whole else imitated_share(imitated, path, guide),
        )

    def _failed(self, run: _Run, reason: str, detail: str, *, tried: bool = False) -> Plan:
        b, counts = self._buffers, self._buffers.counts if tried else np.zeros(COUNT.width, dtype=np.int64)
        path = b.path[: counts[COUNT.full]].copy() if counts[COUNT.full] else run.request.demonstrated.dqs
        return self._made(
            run, joints=run.q[None], reason=reason, detail=detail, imitated_poses=run.request.demonstrated.dqs,
            path_poses=path, tree_rows=b.tree[: counts[COUNT.tree_rows]].copy(), margin=-np.inf, imitated_share=0.0,
        )  # fmt: skip

    def _made(self, run: _Run, **found: Any) -> Plan:
        """Return a plan of the given values and of those that all plans of this planner share."""
        empty = {"reason": "", "how": "", "tree_rows": self._buffers.tree[:0], "detours": 0, "changed": 0}
        same = {"arm": self.arm, "body": self.body, "settings": self.settings, "dt": self.settings.motion.dt}
        if run.constraint is not None:
            same["constraint"] = run.constraint
            if not found.get("reason"):
                motion = PosePath(np.array([self._pose(q) for q in found["joints"]]))
                same["violation"] = violation_of(run.constraint, PosePath(found["imitated_poses"]), motion)
        return Plan(**{**empty, **same, "request": run.request, "tries": 0, "seconds": 0.0, **found})
