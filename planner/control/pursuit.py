"""Pursuit of a path by a kinematic arm, one tick at a time or as a whole roll-out (Algorithm 1, corrected).

The reference is the pose `path[index]`; it advances only while the tcp is within the capture radius, never moves
back, and stays at the last pose until that is reached. (The paper advances it every tick and stops at the end of the
path, which leaves the tcp far from the goal.) With the log law the motion to a distant reference follows one screw:
that is the blend.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_kind, checked_settings
from ..columns import packed_row
from ..errors import BadOption
from ..geometry import screw
from ..geometry.pose import METERS_PER_RADIAN, PosePath
from ..jit import kernel
from ..ranges import check_choice, check_range, check_ranges, ticks_of
from ..robot.arm import Arm
from .arm_arrays import ARM, PURSUIT, PURSUIT_STATE, arm_arrays, pose_and_jacobian
from .controller import ControllerSettings, choose_sign, joint_velocity

PROGRESS, SHARE = 2e-3, 0.1
"""Path length [m], or share of the remaining path length, that counts as progress: an arm that creeps along an
obstacle by less than that during the whole patience has stalled."""
FOLLOWING, ARRIVED, STALLED = 0, 1, 2
"""Status of a pursuit: it continues, it has reached the last pose, or it makes no progress."""


@dataclass(frozen=True, slots=True)
class PursuitSettings:
    """Settings of a pursuit.

    Attributes:
        tau: fraction of the screw to the reference that a tick aims at; scales the gain. The paper's 0.01 belongs to a
            1 kHz loop.
        capture_radius: path length [m] to the reference at which the reference advances.
        position_tolerance: distance to the last pose that counts as arrival [m].
        angle_tolerance: angle to the last pose that counts as arrival [rad].
        patience: time without progress after which the pursuit has stalled [s].
        advance: "capture": the reference advances within the capture radius; "paper": at every tick.
        interpolation: "screw": along one screw to the reference; "decoupled": position straight, orientation by
            slerp. Not in the paper: the alternative that the screw is compared with.
    """

    tau: float = 1.0
    capture_radius: float = 0.010
    position_tolerance: float = 0.001
    angle_tolerance: float = 0.01
    patience: float = 3.0
    advance: str = field(default="capture", metadata={"formerly": "rule"})
    interpolation: str = field(default="screw", metadata={"formerly": "pull", "values": {"apart": "decoupled"}})

    def __post_init__(self):
        check_ranges(self, "(0, 1]", "tau")
        check_choice("advance", self.advance, ("capture", "paper"))
        check_choice("interpolation", self.interpolation, ("screw", "decoupled"))
        check_ranges(self, "(0, inf)", "capture_radius", "position_tolerance", "angle_tolerance", "patience")

    def packed(self) -> np.ndarray:
        """Return the settings as the kernels take them, see `arm_arrays.PURSUIT`."""
        return packed_row(
            PURSUIT,
            tau=self.tau,
            capture_radius=self.capture_radius,
            position_tolerance=self.position_tolerance,
            angle_tolerance=self.angle_tolerance,
            patience=self.patience,
            every_tick=self.advance == "paper",
            decoupled=self.interpolation == "decoupled",
        )


class RollOut(NamedTuple):
    """A roll-out of a pursuit with the kinematic arm.

    Attributes:
        arrived: the last pose was reached within tolerance.
        reason: "" or the reason of the failure: "ik_or_limit" (no progress) or "timeout".
        q: (dof,) joints at the end.
        seconds: duration [s].
        margin: smallest distance of a joint to its limit [rad].
        trace: (ticks + 1, dof) joints at every tick.
    """

    arrived: bool
    reason: str
    q: np.ndarray
    seconds: float
    margin: float
    trace: np.ndarray


@kernel
def restart_pursuit(pursuit_state):
    """Reset the state (4,) of a pursuit, see `arm_arrays.PURSUIT_STATE`, to that of its start."""
    pursuit_state[PURSUIT_STATE.reference], pursuit_state[PURSUIT_STATE.sign] = 0.0, 0.0
    pursuit_state[PURSUIT_STATE.best], pursuit_state[PURSUIT_STATE.waited] = np.inf, 0.0


def fresh_pursuit_state() -> np.ndarray:
    """Return the state (4,) of a pursuit at its start."""
    pursuit_state = np.empty(PURSUIT_STATE.width)
    restart_pursuit(pursuit_state)
    return pursuit_state


@kernel
def pursue(work, path, q, dt, pursuit_state, qdot):
    """Do one tick along a path.

    Args:
        work: array of the arm, see `arm_arrays`.
        path: (n, 8) poses of the tcp.
        q: (dof,) joints.
        dt: duration of the tick [s].
        pursuit_state: (4,) state of the pursuit, see `arm_arrays.PURSUIT_STATE`; changed in place.
        qdot: (dof,) joint speeds, the result.

    Returns:
        The status: FOLLOWING, ARRIVED or STALLED.
    """
    settings = work[ARM.pursuit]
    tau, radius, every_tick = settings[PURSUIT.tau], settings[PURSUIT.capture_radius], settings[PURSUIT.every_tick]
    x = pose_and_jacobian(work, q)
    before = int(pursuit_state[PURSUIT_STATE.reference])
    index, last = before, len(path) - 1
    while True:
        distance, angle = screw.pose_distance(x, screw.load8(path, index))
        left = math.hypot(distance, METERS_PER_RADIAN * angle)
        if index == last or every_tick == 1.0 or left > radius:
            break
        index += 1
    if every_tick == 1.0 and index < last:
        index += 1
    pursuit_state[PURSUIT_STATE.reference] = index
    for i in range(len(q)):
        qdot[i] = 0.0
    near = distance <= settings[PURSUIT.position_tolerance] and angle <= settings[PURSUIT.angle_tolerance]
    if index == last and near:
        return ARRIVED
    best = pursuit_state[PURSUIT_STATE.best]
    if index > before or left < max(best - PROGRESS, (1.0 - SHARE) * best):
        pursuit_state[PURSUIT_STATE.best], pursuit_state[PURSUIT_STATE.waited] = left, 0.0
    else:
        pursuit_state[PURSUIT_STATE.waited] += dt
        if pursuit_state[PURSUIT_STATE.waited] > settings[PURSUIT.patience]:
            return STALLED
    error = screw.mul(screw.conj(x), screw.load8(path, index))
    pursuit_state[PURSUIT_STATE.sign] = choose_sign(error, pursuit_state[PURSUIT_STATE.sign])
    if pursuit_state[PURSUIT_STATE.sign] < 0.0:
        error = screw.neg(error)
    if settings[PURSUIT.decoupled] == 1.0:
        p, turn = screw.translation(error), screw.twist_along(error)
        error = screw.from_twist((p[0], p[1], p[2], turn[3], turn[4], turn[5]))
    if tau < 1.0:
        error = screw.from_twist(screw.scaled(screw.twist_along(error), tau))
    joint_velocity(work, q, error, qdot)
    return FOLLOWING


@kernel
def _roll_out(work, path, q, dt, pursuit_state, qdot, trace):
    """Follow the whole path from q, which is changed in place; returns status, ticks, smallest joint margin."""
    margin = np.inf
    for count in range(len(trace)):
        for i in range(len(q)):
            trace[count, i] = q[i]
            margin = min(margin, q[i] - work[ARM.lower, i], work[ARM.upper, i] - q[i])
        status = pursue(work, path, q, dt, pursuit_state, qdot)
        if status != FOLLOWING:
            return status, count, margin
        for i in range(len(q)):
            q[i] += dt * qdot[i]
    return FOLLOWING, len(trace) - 1, margin


class Pursuit:
    """A pursuit of a path by an arm, tick by tick, on joints that the caller integrates or measures.

    Args:
        arm: the arm.
        path: of the tcp.
        dt: duration of a tick [s].
        controller: settings of the controller.
        settings: settings of the pursuit.

    Raises:
        WrongType: the arm or the path is none.
        BadOption: dt is no positive number, or the gain of the controller is too large for it.
    """

    def __init__(
        self,
        arm: Arm,
        path: PosePath,
        dt: float,
        *,
        controller: ControllerSettings | None = None,
        settings: PursuitSettings | None = None,
    ):
        check_range("dt", dt, "(0, inf)")
        self.arm, self.path, self.dt = checked_kind("arm", arm, Arm), checked_kind("path", path, PosePath), dt
        controller = checked_settings(ControllerSettings, controller, "controller")
        if not 0 < controller.gain * dt <= 1:
            raise BadOption("gain", f"gain * dt = {controller.gain * dt:g} is not in (0, 1]")
        self._work = arm_arrays(arm, controller.packed(), checked_settings(PursuitSettings, settings).packed())
        self._pursuit_state = fresh_pursuit_state()

    @property
    def index(self) -> int:
        """Index of the reference in the path."""
        return int(self._pursuit_state[PURSUIT_STATE.reference])

    def step(self, q: ArrayLike) -> tuple[int, np.ndarray]:
        """Return the status (FOLLOWING, ARRIVED or STALLED) and joint speeds (dof,) at joints q (dof,).

        Raises:
            WrongType, BadShape, NotFinite: q is not (dof,) finite numbers.
        """
        joints, qdot = self.arm.checked(q), np.empty(self.arm.dof)
        return pursue(self._work, self.path.dqs, joints, self.dt, self._pursuit_state, qdot), qdot

    def roll_out(self, q: ArrayLike, max_seconds: float = 60.0) -> RollOut:
        """Follow the whole path with ideal tracking; the pursuit itself is unchanged.

        Args:
            q: (dof,) joints at the start.
            max_seconds: longest duration [s].

        Raises:
            WrongType, BadShape, NotFinite: q is not (dof,) finite numbers.
            BadOption: the duration is negative, or has more than `MAX_TICKS` ticks.
        """
        check_range("max_seconds", max_seconds, "[0, inf)")
        q = self.arm.checked(q).copy()
        trace = np.empty((ticks_of(max_seconds, self.dt) + 1, self.arm.dof))
        pursuit_state, qdot = fresh_pursuit_state(), np.empty(self.arm.dof)
        status, ticks, margin = _roll_out(self._work, self.path.dqs, q, self.dt, pursuit_state, qdot, trace)
        reason = {ARRIVED: "", STALLED: "ik_or_limit", FOLLOWING: "timeout"}[status]
        return RollOut(status == ARRIVED, reason, q, ticks * self.dt, margin, trace[: ticks + 1])
