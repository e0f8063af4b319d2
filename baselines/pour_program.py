"""Pouring from ONE demonstration: fetch the source, lift it, carry and tilt it as shown, seen from the target.

Only the goals are new. The end of the carry is where the demonstrated lip was, seen from the demonstrated rim, so
that glasses of other sizes, held at other heights, need no other demonstration. A round glass looks the same from
everywhere: each turn about its axis gives another goal, and the one next to the demonstrated that can be done is
taken. The lift is a motion relative to where the source stands, which imitation anchored at the target would forget.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..envs.pour_geometry import SOURCE, TARGET
from ..envs.rooms import tool_room
from ..envs.task import TaskDescription
from ..planner.demo import Demonstration
from ..planner.errors import PlanFailed
from ..planner.motions import Motion, plan_motion
from ..planner.pose import Pose, PosePath
from ..planner.segment import resampled
from ..planner.shapes import Obstacle, pack
from ..planner.tsia import departure, imitated_path, screw_path
from .hand import CLOSE, Hand
from .policy import LabeledPath

if TYPE_CHECKING:
    from .screw_policy import ScrewSettings

TURNS = np.deg2rad([0.0, *(sign * turn for turn in range(15, 91, 15) for sign in (1, -1))])
"""Turns about a glass's axis [rad] that are tried, the demonstrated direction first."""
MARGIN = 0.08
"""Distance of the joints to their limits [rad] in a roll-out with which a goal is good enough to look no further."""
NEAR = 0.02
"""Distance [m] to the target from which on the source comes close to it on purpose."""
LIFT = 0.08
"""Height [m] of a lift straight up, where none is shown."""
LOST = 0.03
"""Distance [m] of the source from where it should be in the hand beyond which it was dropped."""


class Size(NamedTuple):
    """Of a round glass, outside [m]."""

    radius: float
    height: float

    @staticmethod
    def of(extents: np.ndarray) -> Size:
        """Of full extents (3,) along its own axes."""
        return Size(0.5 * float(extents[0]), float(extents[2]))


def standing(pose: Pose) -> Pose:
    """The frame of a round glass that stands: its turn about the vertical says nothing."""
    return Pose.from_position_quaternion(pose.position)


def turned_like(held: Pose, shown: Pose) -> Pose:
    """A round glass in the hand, turned about its own axis to be as near as possible to how another is held."""
    return held @ Pose.from_yaw([0, 0, 0], (held.inverse() @ shown).yaw)


def lip_direction(glass: Pose) -> np.ndarray:
    """(2,) direction, in the frame of a tilted glass, of the lowest point of its rim."""
    down = -glass.rotation[2, :2]
    return down / np.linalg.norm(down)


def lip(size: Size, direction: np.ndarray) -> Pose:
    """`glass_from_lip`."""
    return Pose.from_position_quaternion([*(size.radius * direction), 0.5 * size.height])


class PourGoals:
    """Where the hand must end, for glasses anywhere, from where it ended in the demonstration.

    Args:
        task: with the sizes of the glasses.
        shown: the demonstration: "carry" ends relative to the target, "approach", if there, relative to the source.
        held: `tcp_from_source` that is taken for the demonstrated one where no "approach" is shown.
    """

    def __init__(self, task: TaskDescription, shown: Demonstration, held: Pose | None):
        self._sizes = [Size.of(each.size) for each in task.objects]
        names = [segment.name for segment in shown.segments]
        if "approach" in names:
            source = standing(shown.segment("approach").reference_pose)
            self._hand = source.inverse() @ shown.segment_path("approach")[-1]
            held = self._hand.inverse()
        if held is None:
            raise PlanFailed("plan_failed", "the demonstration shows no approach, and the source is not in the hand")
        self.held, sizes = held, [Size.of(shown.object_sizes[each.name]) for each in task.objects]
        end = shown.segment_path("carry")[-1] @ held
        self._direction = lip_direction(end)
        rim = _rim(shown.segment("carry").reference_pose, sizes[TARGET])
        self._rim_from_lip = rim.inverse() @ end @ lip(sizes[SOURCE], self._direction)

    def grasp(self, source: Pose, turn: float) -> Pose:
        """The tcp at a standing source."""
        return Pose.from_yaw(source.position, turn) @ self._hand

    def pouring(self, target: Pose, held: Pose, turn: float) -> Pose:
        """The tcp at the end of the carry, for a source held as `tcp_from_source`."""
        tcp_from_lip = turned_like(held, self.held) @ lip(self._sizes[SOURCE], self._direction)
        rim = _rim(target, self._sizes[TARGET]) @ Pose.from_yaw([0, 0, 0], turn)
        return rim @ self._rim_from_lip @ tcp_from_lip.inverse()


def _rim(target: Pose, size: Size) -> Pose:
    return standing(target) @ Pose.from_position_quaternion([0.0, 0.0, 0.5 * size.height])


class PourProgram:
    """The program of one episode; iterate over `actions()`."""

    SEGMENTS = ("carry",)
    """What a demonstration of this task must have; "approach" too where the source is not in the hand from the start."""

    def __init__(self, task: TaskDescription, shown: Demonstration, settings: ScrewSettings, hand: Hand):
        self.task, self.settings, self.hand = task, settings, hand
        self.shown = {s.name: resampled(shown.segment_path(s.name), settings.resample) for s in shown.segments}
        self.in_hand = bool(hand.observation["motion_index"][0] >= 1.0)
        self.goals = PourGoals(task, shown, self._held() if self.in_hand else None)
        self.paths = [LabeledPath("demonstrated", name, path) for name, path in self.shown.items()]

    def actions(self) -> Iterator[np.ndarray]:
        """Fetch the source if it is not in the hand, lift it, pour, and turn it upright again."""
        hand, names = self.hand, [each.name for each in self.task.objects]
        if self.in_hand:
            yield from hand.grip(CLOSE, self.settings.close)
        else:
            yield from self._fetch(names[SOURCE])
        grasped = self._held()
        hand.hold(SOURCE, self.task.objects[SOURCE].shape, grasped)
        hand.allow([("held", each.name) for each in self.task.furniture[:1]])
        yield from hand.follow(self._lift(hand.arm.fk(hand.q)), loosely=True)
        hand.allow(())
        # the source slips a little while it is lifted: the goal is computed from how it is held now
        held = self._held()
        if held.gap(grasped)[0] > LOST:
            raise PlanFailed("dropped", f"{names[SOURCE]} is not in the hand after the lift")
        hand.hold(SOURCE, self.task.objects[SOURCE].shape, held)
        yield from self._pour(self._chosen_carry(hand.q, held), held, names[TARGET])

    def _held(self) -> Pose:
        """`tcp_from_source` as observed."""
        return self.hand.measured_tcp.inverse() @ self.hand.object_pose(SOURCE)

    def _fetch(self, name: str) -> Iterator[np.ndarray]:
        self.hand.allow([("fingers", name), ("hand", name)])
        motion = self._chosen_fetch()
        self.paths.append(LabeledPath("final", f"fetch {name}", motion.final_path))
        yield from self.hand.follow(motion.tail)
        yield from self.hand.wait(self.settings.settle)
        yield from self.hand.grip(CLOSE, self.settings.close)

    def _lift(self, start: Pose) -> PosePath:
        """As shown, from where the hand is; straight up if it is not shown."""
        if "lift" in self.shown:
            return departure(self.shown["lift"], start, np.inf)
        up = Pose.from_position_quaternion([0.0, 0.0, LIFT]) @ start
        return screw_path(start, up, self.settings.resample)

    def _pour(self, motion: Motion, held: Pose, target: str) -> Iterator[np.ndarray]:
        """Carry, then tilt: near the target, the source may come as near to it as was shown."""
        self.paths.append(LabeledPath("final", "carry and pour", motion.final_path))
        split = self._close_from(motion.tail, held)
        yield from self.hand.follow(motion.tail[: split + 1], loosely=True)
        self.hand.allow([("held", target)])
        yield from self.hand.follow(motion.tail[split:])
        yield from self.hand.wait(self.settings.drain)
        back = imitated_path(self.shown["return"], self._upright(motion)) if "return" in self.shown else None
        yield from self.hand.follow(motion.tail[split:].reversed() if back is None else back, loosely=True)

    def _upright(self, motion: Motion) -> Pose:
        """Where the shown return ends, done from the end of the motion."""
        back = self.shown["return"]
        return motion.tail[-1] @ back[0].inverse() @ back[-1]

    def _close_from(self, path: PosePath, held: Pose) -> int:
        """Index of the pose from which on the source stays near the target."""
        body = self.task.bodies[0].holding("held", self.task.objects[SOURCE].shape, held, self.hand.arm)
        tool, shape = body.tool(self.hand.arm), self.task.objects[TARGET].shape
        target = pack([Obstacle(shape, self.hand.object_pose(TARGET))])
        rooms = np.array([tool_room(tool, row[None], target) for row in path.dqs])
        far = np.flatnonzero(rooms > NEAR)
        return int(far[-1]) if len(far) else 0

    def _chosen_fetch(self) -> Motion:
        """The grasp, and with it the pouring, that is nearest to what was shown and can be done."""
        hand, best = self.hand, None
        for turn in TURNS:
            goal = self.goals.grasp(hand.object_pose(SOURCE), turn)
            fetch = plan_motion(hand.arm, hand.q, self.shown["approach"], goal, self.settings.motion)
            if not fetch.arrives:
                best = best or (-np.inf, fetch)
                continue
            lift = self._lift(goal)
            raised = plan_motion(hand.arm, fetch.q, lift, lift[-1], self.settings.motion)
            carry = self._chosen_carry(raised.q, self.goals.held)
            margin = min(fetch.margin, raised.margin, carry.margin) if raised.arrives and carry.arrives else -1.0
            if best is None or margin > best[0]:
                best = (margin, fetch)
            if margin >= MARGIN:
                break
        assert best is not None
        if not best[1].arrives:
            raise PlanFailed(best[1].reason, "no turn of the source can be grasped as demonstrated")
        return best[1]

    def _chosen_carry(self, q: np.ndarray, held: Pose) -> Motion:
        """The pouring direction that is nearest to what was shown and can be done from joints q."""
        hand, best = self.hand, None
        for turn in TURNS:
            goal = self.goals.pouring(hand.object_pose(TARGET), held, turn)
            motion = plan_motion(hand.arm, q, self.shown["carry"], goal, self.settings.motion)
            if best is None or (motion.arrives, motion.margin) > (best.arrives, best.margin):
                best = motion
            if best.arrives and best.margin >= MARGIN:
                break
        assert best is not None
        return best
