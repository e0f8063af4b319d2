"""Pouring with two hands from the demonstration of one: the relative motion of the glasses is imitated.

Lip and rim are the frames of imitation, so that glasses of other sizes need no other demonstration. The place and
direction of pouring in the world and the yaw of the round glasses in the hands are irrelevant to the task: the first
choice is taken with which both arms arrive, clear of each other and of the trunk.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import product
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ...envs import TaskDescription
from ...envs.pour.facts import SOURCE, TARGET
from ...planner import Demonstration, Pose, PosePath
from ...planner.errors import PlanFailed
from ...planner.geometry import dualquat as dq
from ...planner.imitation.bimanual import shared_translation
from ...planner.imitation.segmentation import resampled
from ...planner.robot.kinematics import CHAIN
from ...planner.skills.alike import standing
from ...planner.skills.segments import RIM, anchored, lip_of
from ..policy import LabeledPath
from .dual_arm_executor import DualArmExecutor, DualArmRollOut, Paths
from .thought import Thought

if TYPE_CHECKING:
    from ..motion.settings import ProgramSettings

POUR_YAWS = np.deg2rad((120.0, 105.0, 135.0, 90.0))
"""Directions of pouring [rad] in the world to try: to the left and away from the robot."""
SIDES = np.deg2rad((-60.0, -75.0, -90.0, -45.0))
"""Yaw [rad] of the pouring hand relative to the pouring direction: the hand comes from the side and tilts by roll."""
HOLDER_YAWS = np.deg2rad((-60.0, -30.0, -90.0))
"""Directions of the hand with the target [rad] in the world."""
PLACES = ((0.80, 0.0, 0.25), (0.74, 0.0, 0.15), (0.69, 0.0, 0.10))
"""Positions of the target's rim at the end [m], relative to the middle between the two shoulders."""
SHARE = 0.5
"""The left hand's fraction of the translation; it never rotates, so that the target stays upright."""
FURTHER, LOWER = 0.004, 0.008
"""Displacement of the lip's end [m], further over the target and lower than demonstrated: this target is narrower."""
MARGIN = 0.08
"""Distance of the joints to their limits [rad] in a roll-out from which a choice ends the search."""
SLOW = 0.008
"""Path length [m] within which both hands follow, which limits their speed."""
LEAST = 60
"""Largest number of choices rolled out."""


class PourSwing(NamedTuple):
    """Paths of pouring.

    Attributes:
        forth: paths of the right and the left tcp, from the start to the end of pouring.
        back: paths of both until the source is upright again.
    """

    forth: Paths
    back: Paths


class BimanualPourProgram:
    """The program of one episode; iterate over `actions()`.

    Args:
        task: the task.
        shown: the demonstration.
        settings: see `ProgramSettings`.
        hands: executor of both arms.
    """

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ProgramSettings, hands: DualArmExecutor):
        self.task, self.settings, self.hands = task, settings, hands
        self._sizes = [each.size for each in task.objects]
        self._read(shown)
        self.paths = [LabeledPath("demonstrated", "carry", shown.segment_path("carry"))]

    def _read(self, shown: Demonstration) -> None:
        """Read the relative paths rim_from_lip of the demonstration."""
        sizes = [shown.object_sizes[each.name] for each in self.task.objects]
        source = standing(shown.segment("approach").reference_pose)
        held = shown.segment_path("approach")[-1].inverse() @ source
        self._lip = lip_of(shown.segment_path("carry")[-1] @ held)
        tool = held @ anchored(self._lip, sizes[SOURCE])
        rim = standing(shown.segment("carry").reference_pose) @ anchored(RIM, sizes[TARGET])
        shift = Pose.from_position_quaternion([*(FURTHER * np.array(self._lip[:2])), -LOWER])
        step = self.settings.resample
        self._carry, self._return = (
            resampled(shown.segment_path(name), step).moved(rim.inverse()).with_tool(tool).moved(shift)
            for name in ("carry", "return")
        )

    def actions(self) -> Iterator[np.ndarray]:
        """Bring the glasses together, pour, and turn the source upright again."""
        hands = self.hands
        yield from hands.wait(self.settings.settle)
        held = [hands.held(k, k) for k in (SOURCE, TARGET)]
        hands.hold(held)
        choice = yield from self._chosen(held)
        self.paths += [
            LabeledPath("final", name, path) for name, path in zip(("source", "target"), choice.forth, strict=True)
        ]
        yield from hands.move(choice.forth, SLOW)
        yield from hands.wait(self.settings.drain)
        yield from hands.move(choice.back, SLOW)

    def _chosen(self, held: list[Pose]) -> Thought[PourSwing]:
        """Return the first choice whose roll-out arrives clear of the joint limits, else the best that arrives."""
        best: tuple[float, PourSwing] | None = None
        failed = DualArmRollOut("ik_or_limit", self.hands.q, 0.0)
        choices = product(PLACES, POUR_YAWS, HOLDER_YAWS, SIDES)
        for _, (place, pour, holder, side) in zip(range(LEAST), choices, strict=False):
            choice = self._choice(held, np.array(place), pour, pour + side, holder)
            result = yield from self.hands.thought(self.hands.roll_out(choice.forth, SLOW))
            if result.reason:
                failed = result
            elif result.margin >= MARGIN:
                return choice
            elif best is None or result.margin > best[0]:
                best = (result.margin, choice)
        if best is None:
            raise PlanFailed(failed.reason, "no place and direction of pouring was found that both arms can reach")
        return best[1]

    def _choice(self, held: list[Pose], place: np.ndarray, pour: float, pourer: float, holder: float) -> PourSwing:
        """Return the paths of both tcps.

        Args:
            held: `tcp_from_object` of source and target.
            place: (3,) of the target's rim at the end, relative to the middle between the shoulders [m].
            pour: direction of pouring in the world [rad].
            pourer: direction of the right hand while the source is upright [rad].
            holder: direction of the left hand [rad].
        """
        shoulders = np.mean([arm.chain[0, CHAIN.offset : CHAIN.kind] for arm in self.task.arms], axis=0)
        shown_yaw = float(np.arctan2(self._lip[1], self._lip[0]))
        turn = pour - shown_yaw
        world_from_rim = Pose.from_yaw(shoulders + place, turn)
        # the round glasses, turned in the hands so that the hands point in their directions
        tool = _turned(held[SOURCE], turn, pourer) @ anchored(self._lip, self._sizes[SOURCE])
        hold = _turned(held[TARGET], turn, holder) @ anchored(RIM, self._sizes[TARGET])
        right, left = (arm.fk(q) for arm, q in zip(self.task.arms, self.hands.q, strict=True))
        now = (left @ hold).inverse() @ right @ tool
        relative, tail = self.hands.motion_method.relative(self._carry, now)
        rims, _ = shared_translation(relative[len(relative) - tail :], world_from_rim, SHARE)
        blend = _in_equal_steps(left @ hold, rims[0], len(relative) - tail)
        rims = PosePath(np.concatenate([blend.dqs, rims.dqs]))
        lips = _composed(rims, relative)
        back = self._return.moved(relative[-1] @ self._return[0].inverse())
        still = PosePath(np.repeat(rims.dqs[-1:], len(back), axis=0))
        from_lip, from_rim = tool.inverse(), hold.inverse()
        return PourSwing(
            (lips.with_tool(from_lip), rims.with_tool(from_rim)),
            (_composed(still, back).with_tool(from_lip), still.with_tool(from_rim)),
        )


def _turned(held: Pose, glass: float, hand: float) -> Pose:
    """Turn a round glass in the hand so that the hand's yaw is `hand` when the glass's yaw is `glass` [rad]."""
    approach = held.inverse().rotation[:2, 2]
    return held @ Pose.from_yaw([0, 0, 0], float(np.arctan2(approach[1], approach[0])) - (hand - glass))


def _in_equal_steps(start: Pose, end: Pose, count: int) -> PosePath:
    """Return `count` poses along the screw between two poses, without its end."""
    return PosePath(dq.sclerp(start.dq, end.dq, np.arange(count) / max(count, 1)))


def _composed(first: PosePath, second: PosePath) -> PosePath:
    """Return the products pose by pose."""
    return PosePath(dq.mul(first.dqs, second.dqs))
