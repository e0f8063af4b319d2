"""One motion of a task: leave as shown, blend along a screw, arrive as shown, at what the arm can reach."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import partial
from typing import NamedTuple

import numpy as np

from .arm import Arm
from .controller import ControllerSettings
from .errors import BadOption, PlanFailed
from .ik import path_margins
from .pose import Pose, PosePath
from .pursuit import Pursuit, PursuitSettings, RollOut
from .tsia import departure, final_path, guide_index, imitated_path, reachable_guide, screw_path


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """How a demonstrated segment becomes a motion.

    Attributes:
        guide: fraction of the imitated path at which the blend ends (paper: 0.2).
        max_guide: fraction behind which too little of the path would be left.
        departure: screw length [m] of the start-anchored departure; 0 for the paper's plain form.
        min_margin: smallest distance to a joint limit [rad] that a motion should keep.
        controller: the control law.
        pursuit: how a path is followed.
        dt: seconds per tick.
    """

    guide: float = 0.5
    max_guide: float = 0.75
    departure: float = 0.09
    min_margin: float = 0.1
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    pursuit: PursuitSettings = field(default_factory=PursuitSettings)
    dt: float = 0.02

    def __post_init__(self):
        if not 0.0 <= self.guide <= self.max_guide <= 1.0:
            raise BadOption("guide", f"need 0 <= guide <= max_guide <= 1, got {self.guide} and {self.max_guide}")
        for name in ("departure", "min_margin"):
            if getattr(self, name) < 0.0:
                raise BadOption(name, f"{getattr(self, name)} is negative")


class Motion(NamedTuple):
    """A motion as planned, with its kinematic roll-out.

    Attributes:
        departure: start-anchored beginning, followed loosely; None if there is none.
        tail: the imitated path from the guiding pose on.
        final_path: departure, blend and tail as one path, for drawing and measuring.
        imitated: the whole imitated path.
        q: (dof,) joints at the end of the roll-out.
        margin: smallest joint margin [rad] in the roll-out.
        seconds: duration of the roll-out.
        reason: "" if the roll-out arrives, else why not.
    """

    departure: PosePath | None
    tail: PosePath
    final_path: PosePath
    imitated: PosePath
    q: np.ndarray
    margin: float
    seconds: float
    reason: str

    @property
    def arrives(self) -> bool:
        """The kinematic arm reaches the end."""
        return not self.reason


def follow(arm: Arm, path: PosePath, settings: MotionSettings, *, loosely: bool = False) -> Pursuit:
    """A pursuit of the path; loosely: it has arrived when it is within the capture radius."""
    pursuit = settings.pursuit
    if loosely:
        radius = pursuit.capture_radius
        pursuit = replace(pursuit, position_tolerance=radius, angle_tolerance=5.0 * radius)
    return Pursuit(arm, path, settings.dt, controller=settings.controller, settings=pursuit)


def reachable_departure(
    arm: Arm, q: np.ndarray, leaving: PosePath, settings: MotionSettings
) -> tuple[PosePath, RollOut]:
    """The departure as shown; where the arm cannot do it, straight up by as much, if it can do that."""
    start = arm.fk(q)
    up = Pose.from_position_quaternion([0.0, 0.0, settings.departure]) @ start
    options = (
        departure(leaving, start, settings.departure),
        screw_path(start, up, settings.pursuit.capture_radius),
    )
    tries = [(path, follow(arm, path, settings, loosely=True).roll_out(q)) for path in options]
    return max(tries, key=lambda option: option[1].arrived)


def plan_motion(
    arm: Arm,
    q: np.ndarray,
    demonstrated: PosePath,
    goal: Pose,
    settings: MotionSettings,
    *,
    leaving: PosePath | None = None,
) -> Motion:
    """The motion of a demonstrated segment from joints q to a goal pose of the tcp.

    If the roll-out with the wanted guide fails or comes too close to a joint limit, the guide is moved on to
    where the whole tail can be reached; of the two the one that arrives, then the one with more margin, is
    taken.

    Args:
        arm: the arm.
        q: (dof,) joints at the start.
        demonstrated: the segment.
        goal: the pose to end at.
        settings: see `MotionSettings`.
        leaving: what to imitate when departing from the start; None: nothing, blend at once.
    """
    away = None
    before = RollOut(True, "", q, 0.0, arm.margin(q), q[None])
    if leaving is not None and settings.departure > 0:
        away, before = reachable_departure(arm, q, leaving, settings)
    imitated = imitated_path(demonstrated, goal)
    first = guide_index(imitated, settings.guide)
    motion = _rolled_out(arm, before, away, imitated, first, settings)
    if motion.arrives and motion.margin >= settings.min_margin:
        return motion
    last = guide_index(imitated, settings.max_guide)
    try:
        margins = partial(path_margins, arm, goal_joints=motion.q)
        guide = reachable_guide(imitated, first, last, margins, settings.min_margin)
    except PlanFailed:
        guide = last
    other = _rolled_out(arm, before, away, imitated, guide, settings)
    return max(motion, other, key=lambda m: (m.arrives, min(m.margin, settings.min_margin)))


def _rolled_out(
    arm: Arm,
    before: RollOut,
    away: PosePath | None,
    imitated: PosePath,
    guide: int,
    settings: MotionSettings,
) -> Motion:
    """The motion with a given guide, after the roll-out of the departure."""
    tail = imitated[guide:]
    after = follow(arm, tail, settings).roll_out(before.q)
    start = arm.fk(before.q) if away is None else away[-1]
    path = final_path(start, imitated, guide)
    return Motion(
        away,
        tail,
        path if away is None else away.joined(path),
        imitated,
        after.q,
        min(before.margin, after.margin),
        before.seconds + after.seconds,
        before.reason or after.reason,
    )


def warm_up(arm: Arm) -> None:
    """Compile, or load from the cache, everything that a motion may need, so that no tick has to wait for it."""
    q = 0.5 * (np.where(np.isfinite(arm.lower), arm.lower, -1.0) + np.where(np.isfinite(arm.upper), arm.upper, 1.0))
    start = arm.fk(q)
    path = screw_path(start, Pose.from_position_quaternion([0.0, 0.0, 0.02]) @ start, 0.005)
    # a margin that no arm has makes every branch run
    plan_motion(arm, q, path, path[-1], MotionSettings(min_margin=100.0), leaving=path)
    follow(arm, path, MotionSettings()).step(q)
