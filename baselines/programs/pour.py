"""Pouring from ONE demonstration: fetch the source, lift it, carry and tilt it as demonstrated relative to the target.

Only the goals are new, see `pour_goals`. Among the yaws of a round glass, the feasible one nearest to the
demonstrated yaw is taken. The lift is a motion relative to the initial pose of the source, which imitation anchored at
the target would lose.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...envs import TaskDescription
from ...envs.pour.geometry import SOURCE, TARGET
from ...envs.scene.body_clearance import tool_clearance
from ...planner import Body, Demonstration, Obstacle, Plan, Pose, PosePath, imitated_path
from ...planner.errors import PlanFailed
from ...planner.geometry.shapes import pack
from ...planner.imitation.segmentation import resampled
from ...planner.imitation.tsia import departure, screw_path
from ..motion.motion_method import DIRECT, MADE, MotionPlanner
from ..policy import LabeledPath
from .arm_executor import CLOSE, OFF, ArmExecutor
from .pour_goals import PourGoals

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

TURNS = np.deg2rad([0.0, *(sign * turn for turn in range(15, 91, 15) for sign in (1, -1))])
"""Rotations about a glass's axis [rad] to try, the demonstrated direction first."""
MARGIN = 0.08
"""Distance of the joints to their limits [rad] in a roll-out from which a goal ends the search."""
PACE = 0.5
"""Fraction of the joints' speed limits in use: a glass moved faster slips and lags behind its guarded pose."""
NEAR = 0.02
"""Distance [m] to the target below which the source approaches the target intentionally."""
LIFT = 0.08
"""Height [m] of a lift straight up, if none was demonstrated."""
CHANCES = 3
"""Number of attempts where the carry is blocked."""


class Leg(NamedTuple):
    """Demands of a leg of the program on its plans.

    Attributes:
        allowed: contacts that are wanted.
        must_keep: a plan that keeps nothing of the demonstration fails: a full glass is not tilted in any other way.
    """

    allowed: tuple[tuple[str, str], ...] = ()
    must_keep: bool = False


class CarryCandidate(NamedTuple):
    """Consecutive motions as planned.

    Attributes:
        paths: paths to follow.
        plans: the plan of each path.
        q: (dof,) joints at the end [rad].
        margin: smallest joint margin on the way [rad].
        rank: 2 as demonstrated, 1 with a detour or through joint space, 0 does not arrive.
        reason: "" or the reason of failure.
        detail: the facts of the failure.
    """

    paths: tuple[PosePath, ...]
    plans: tuple[Plan | None, ...]
    q: np.ndarray
    margin: float
    rank: int
    reason: str = ""
    detail: str = ""

    def then(self, other: CarryCandidate) -> CarryCandidate:
        """Return this candidate followed by another."""
        margin, rank = min(self.margin, other.margin), min(self.rank, other.rank)
        paths, plans = (*self.paths, *other.paths), (*self.plans, *other.plans)
        reason, detail = (self.reason, self.detail) if self.reason else (other.reason, other.detail)
        return CarryCandidate(paths, plans, other.q, margin, rank, reason, detail)

    @property
    def order(self) -> tuple[int, bool, float]:
        """Sort key, larger is better."""
        return self.rank, self.margin >= MARGIN, self.margin


class PourProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        shown: the demonstration.
        settings: see `ProgramSettings`.
        executor: executor of the arm.
    """

    SEGMENTS = ("carry",)
    """Segments required of a demonstration; "approach" too if the source is not in the hand from the start."""
    SIZED: tuple[str, ...] = ("source", "target")
    """Objects whose sizes a demonstration must give."""
    RELEASE = ""
    """Segment after which the recorded gripper decides how far this one opens; "" for none."""

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ProgramSettings, executor: ArmExecutor):
        self.task, self.settings, self.executor = task, settings, executor
        executor.slow_down(PACE)
        self.shown = {s.name: resampled(shown.segment_path(s.name), settings.resample) for s in shown.segments}
        self.in_hand = bool(executor.observation["motion_index"][0] >= 1.0)
        self.goals = PourGoals(task, shown, executor.tcp_from(SOURCE) if self.in_hand else None)
        self.paths = [LabeledPath("demonstrated", name, path) for name, path in self.shown.items()]
        self.source, self.target = (each.name for each in task.objects)
        self._plan = settings.reactive.plan
        self._carrying, self._lifting = Leg(), Leg((("held", task.furniture[SOURCE].name),))
        self._at_glass = (
            Leg((("fingers", self.source), ("hand", self.source))),
            Leg((("held", self.target),), must_keep=True),
        )

    def actions(self) -> Iterator[np.ndarray]:
        """Fetch the source if it is not in the hand, lift it, pour, and turn it upright again."""
        executor = self.executor
        if self.in_hand:
            yield from executor.grip(CLOSE, self.settings.close)
        else:
            yield from self._fetch()
        grasped, shape = executor.tcp_from(SOURCE), self.task.objects[SOURCE].shape
        executor.hold(SOURCE, shape, grasped)
        if self._stands():
            executor.allow(self._lifting.allowed)
            yield from executor.leave(self._lift(executor.arm.fk(executor.q)), OFF)
        # the source slips a little during the lift: the goal is computed from its present pose in the hand
        held = executor.lifted()
        executor.hold(SOURCE, shape, held)
        yield from self._carry(held)
        yield from executor.wait(self.settings.drain)
        yield from self._return()

    def _stands(self) -> bool:
        """Return True if the source is on its stand, from which it must be lifted."""
        bottom = self.executor.object_pose(SOURCE).position - [0.0, 0.0, 0.5 * self.task.objects[SOURCE].size[2]]
        return float(np.linalg.norm(bottom - self.executor.observation["furniture_pose"][SOURCE, :3])) < OFF

    def _fetch(self) -> Iterator[np.ndarray]:
        candidate = self._chosen_fetch()
        before, after, *_ = candidate.paths
        self.paths.append(LabeledPath("final", f"fetch {self.source}", before.joined(after)))
        yield from self.executor.follow(before, exact=False, plan=candidate.plans[0])
        self.executor.allow(self._at_glass[SOURCE].allowed)
        yield from self.executor.follow(after, plan=candidate.plans[1])
        yield from self.executor.wait(self.settings.settle)
        yield from self.executor.grip(CLOSE, self.settings.close)

    def _lift(self, start: Pose) -> PosePath:
        """Return the demonstrated lift from the present pose of the hand; straight up if none was demonstrated."""
        if "lift" in self.shown:
            return departure(self.shown["lift"], start, np.inf)
        up = Pose.from_position_quaternion([0.0, 0.0, LIFT]) @ start
        return screw_path(start, up, self.settings.resample)

    def _carry(self, held: Pose) -> Iterator[np.ndarray]:
        """Carry, then tilt; another path is searched where one proves blocked."""
        failed: list[float] = []
        while True:
            candidate, turn = self._chosen_carry(self.executor.q, held, failed, thoroughly=True)
            carry, tilt = candidate.paths
            self.paths.append(LabeledPath("final", "carry and pour", carry.joined(tilt)))
            self.executor.allow(())
            try:
                yield from self.executor.follow(carry, exact=False, plan=candidate.plans[0])
                # near the target, the source may come as close to the target as demonstrated
                leg = self._at_glass[TARGET]
                self.executor.allow(leg.allowed)
                yield from self.executor.follow(tilt, plan=candidate.plans[1], must_keep=leg.must_keep)
                return
            except PlanFailed:
                failed.append(turn)
                if len(failed) == CHANCES:
                    raise

    def _return(self) -> Iterator[np.ndarray]:
        """Return the source to upright, as demonstrated, if demonstrated."""
        if "return" in self.shown:
            back = self.shown["return"]
            here = self.executor.arm.fk(self.executor.q)
            yield from self.executor.follow(imitated_path(back, here @ back[0].inverse() @ back[-1]), exact=False)

    def _body(self, held: Pose) -> Body:
        return self.task.bodies[0].holding("held", self.task.objects[SOURCE].shape, held, self.executor.arm)

    def _named_obstacles(self, body: Body) -> list[Obstacle]:
        """Return the obstacles around an arm, without the moving ones."""
        seen = self.executor.world_model.obstacles(self.executor.observation)
        still = [each for each in seen if not np.any(each.velocity)]
        return [each for each in still if not (body.held and each.name == self.source)]

    def _near(self, index: int, path: PosePath, body: Body) -> int:
        """Return the index of the pose from which the hand, or the held object, stays near a glass."""
        glass = pack([Obstacle(self.task.objects[index].shape, self.executor.object_pose(index))])
        tool = body.tool(self.executor.arm)
        clearances = np.array([tool_clearance(tool, row[None], glass) for row in path.dqs])
        far = np.flatnonzero(clearances > NEAR)
        return max(1, int(far[-1])) if len(far) else 1

    def _planned(self, planner: MotionPlanner, path: PosePath, q: np.ndarray, leg: Leg) -> CarryCandidate:
        """Plan a motion to the end of a path, around obstacles."""
        contacts, around = (*self.task.touching, *leg.allowed), self._named_obstacles(planner.body)
        plan = planner.plan(path, q, path[-1], around, allowed=contacts, must_keep=leg.must_keep)
        followed = path if plan.how == "joint search" or not plan.success else plan.path
        as_shown = plan.how == DIRECT or (plan.how in MADE and plan.imitated_share == 1.0)
        rank = 0 if not plan.success else 2 if as_shown else 1
        reason = "" if plan.success else "ik_or_limit" if plan.reason == "ik_or_limit" else "blocked"
        return CarryCandidate(
            (followed,), (plan,), plan.joints[-1], plan.margin if plan.success else -np.inf, rank, reason, plan.why
        )

    def _chosen_fetch(self) -> CarryCandidate:
        """Return the feasible grasp, with its pouring, that is nearest to the demonstration."""
        executor, best, held = self.executor, None, self.goals.held
        empty = executor.motion_method.planner(executor.arm, self.task.bodies[0], self._plan)
        full = executor.motion_method.planner(executor.arm, self._body(held), replace(self._plan, search=None))
        for turn in TURNS:
            goal = self.goals.grasp(executor.object_pose(SOURCE), turn)
            candidate = self._in_two(empty, imitated_path(self.shown["approach"], goal), executor.q, SOURCE)
            if candidate.rank:
                candidate = candidate.then(self._planned(full, self._lift(goal), candidate.q, self._lifting))
            if candidate.rank:
                candidate = candidate.then(self._chosen_carry(candidate.q, held, [], thoroughly=False)[0])
            if best is None or (len(candidate.paths), candidate.order) > (len(best.paths), best.order):
                best = candidate
            if best.rank and best.margin >= MARGIN:
                break
        assert best is not None
        if len(best.paths) == 2 and not best.rank:
            raise PlanFailed(best.reason, f"no turn of {self.source} can be grasped as demonstrated: {best.detail}")
        return best

    def _chosen_carry(
        self, q: np.ndarray, held: Pose, failed: list[float], *, thoroughly: bool
    ) -> tuple[CarryCandidate, float]:
        """Return the feasible direction of pouring nearest to the demonstration from joints q, and its rotation.

        Args:
            q: (dof,) joints at the start [rad].
            held: `tcp_from_source`.
            failed: rotations tried without success [rad].
            thoroughly: True: also search in joint space.
        """
        body = self._body(held)
        quick = self.executor.motion_method.planner(self.executor.arm, body, replace(self._plan, search=None))
        tries = []
        for turn in TURNS:
            if turn not in failed:
                tries.append((self._carried(quick, q, held, turn), turn))
                if tries[-1][0].rank == 2 and tries[-1][0].margin >= MARGIN:
                    return tries[-1]
        best = max(tries, key=lambda each: each[0].order)
        if best[0].rank == 0 and thoroughly:
            thorough = self.executor.motion_method.planner(self.executor.arm, body, self._plan)
            tries = [(self._carried(thorough, q, held, turn), turn) for _, turn in tries[:CHANCES]]
            best = max(tries, key=lambda each: each[0].order)
        return best

    def _carried(self, planner: MotionPlanner, q: np.ndarray, held: Pose, turn: float) -> CarryCandidate:
        """Plan the carry and the tilt of one rotation."""
        goal = self.goals.pouring(self.executor.object_pose(TARGET), held, turn)
        return self._in_two(planner, imitated_path(self.shown["carry"], goal), q, TARGET)

    def _in_two(self, planner: MotionPlanner, path: PosePath, q: np.ndarray, glass: int) -> CarryCandidate:
        """Plan a path that ends near a glass in two parts; only the second may touch the glass."""
        split = self._near(glass, path, planner.body)
        before, after = path[: split + 1], path[split:]
        candidate = self._planned(planner, before, q, self._carrying)
        if candidate.rank == 0:
            return candidate._replace(paths=(before, after), plans=(None, None))
        return candidate.then(self._planned(planner, after, candidate.q, self._at_glass[glass]))
