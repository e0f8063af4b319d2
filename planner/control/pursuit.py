"""Following a path with a kinematic arm, one tick at a time or as a whole roll-out (Algorithm 1, corrected).

The reference is the pose `path[index]`; it advances only while the tcp is within the capture radius, never
goes back, and stays at the last pose until that is reached. (The paper advances it every tick and stops when
it runs out, which ends far from the goal.) With the log law the pull to a reference that is far away moves
along one screw: that is the blend.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BadOption
from ..geometry import screw
from ..geometry.pose import METERS_PER_RADIAN, PosePath
from ..jit import kernel
from ..robot.arm import Arm
from .arm_arrays import LIMITS, PURSUIT, arm_arrays, pose_and_jacobian
from .controller import ControllerSettings, choose_sign, joint_velocity

PROGRESS, SHARE = 2e-3, 0.1
"""Screw length [m], or share of what is left, that counts as progress: what creeps along an obstacle by less in the
whole patience has stalled."""
FOLLOWING, ARRIVED, STALLED = 0, 1, 2
INDEX, SIGN, BEST, WAITED = 0, 1, 2, 3


@dataclass(frozen=True, slots=True)
class PursuitSettings:
    """How a path is followed.

    Attributes:
        tau: fraction of the screw to the reference that is aimed at in a tick; scales the gain.
            The paper's 0.01 belongs to a 1 kHz loop.
        capture_radius: screw length [m] to the reference at which it advances.
        position_tolerance: arrival [m].
        angle_tolerance: arrival [rad].
        patience: seconds without progress after which it has stalled.
        advance: "capture" as above, or "paper": the reference advances every tick.
        interpolation: "screw": along one screw to the reference; "decoupled": position straight, orientation by
            slerp. Not in the paper: what the screw is compared with.
    """

    tau: float = 1.0
    capture_radius: float = 0.010
    position_tolerance: float = 0.001
    angle_tolerance: float = 0.01
    patience: float = 3.0
    advance: str = field(default="capture", metadata={"formerly": "rule"})
    interpolation: str = field(default="screw", metadata={"formerly": "pull", "values": {"apart": "decoupled"}})

    def __post_init__(self):
        if not 0 < self.tau <= 1:
            raise BadOption("tau", f"{self.tau} is not in (0, 1]")
        if self.advance not in ("capture", "paper"):
            raise BadOption("advance", f"{self.advance!r} is not one of capture, paper")
        if self.interpolation not in ("screw", "decoupled"):
            raise BadOption("interpolation", f"{self.interpolation!r} is not one of screw, decoupled")
        for name in ("capture_radius", "position_tolerance", "angle_tolerance", "patience"):
            if not 0 < getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")

    def packed(self) -> tuple[float, ...]:
        """The settings as the kernels take them."""
        tolerances = (self.position_tolerance, self.angle_tolerance)
        choices = float(self.advance == "paper"), float(self.interpolation == "decoupled")
        return (self.tau, self.capture_radius, *tolerances, self.patience, *choices)


class RollOut(NamedTuple):
    """A path followed by the kinematic arm.

    Attributes:
        arrived: the last pose was reached within tolerance.
        reason: "" or why not: "ik_or_limit" (no progress) or "timeout".
        q: (dof,) joints at the end.
        seconds: duration.
        margin: smallest distance of a joint to its limit on the way [rad].
        trace: (ticks + 1, dof) joints on the way.
    """

    arrived: bool
    reason: str
    q: np.ndarray
    seconds: float
    margin: float
    trace: np.ndarray


def fresh_pursuit_state() -> np.ndarray:
    """The memory (4,) of a pursuit that has not begun."""
    return np.array([0.0, 0.0, np.inf, 0.0])


@kernel
def pursue(work, path, q, dt, pursuit_state, qdot):
    """One tick along the path (n, 8): joint speeds into `qdot`, the state of the pursuit in `pursuit_state` (4,)."""
    tau, radius, every_tick = work[PURSUIT, 0], work[PURSUIT, 1], work[PURSUIT, 5]
    x = pose_and_jacobian(work, q)
    before = int(pursuit_state[INDEX])
    index, last = before, len(path) - 1
    while True:
        distance, angle = screw.pose_distance(x, screw.load8(path, index))
        left = math.hypot(distance, METERS_PER_RADIAN * angle)
        if index == last or every_tick == 1.0 or left > radius:
            break
        index += 1
    if every_tick == 1.0 and index < last:
        index += 1
    pursuit_state[INDEX] = index
    for i in range(len(q)):
        qdot[i] = 0.0
    if index == last and distance <= work[PURSUIT, 2] and angle <= work[PURSUIT, 3]:
        return ARRIVED
    best = pursuit_state[BEST]
    if index > before or left < max(best - PROGRESS, (1.0 - SHARE) * best):
        pursuit_state[BEST], pursuit_state[WAITED] = left, 0.0
    else:
        pursuit_state[WAITED] += dt
        if pursuit_state[WAITED] > work[PURSUIT, 4]:
            return STALLED
    error = screw.mul(screw.conj(x), screw.load8(path, index))
    pursuit_state[SIGN] = choose_sign(error, pursuit_state[SIGN])
    if pursuit_state[SIGN] < 0.0:
        error = screw.neg(error)
    if work[PURSUIT, 6] == 1.0:
        p, turn = screw.translation(error), screw.twist_along(error)
        error = screw.from_twist((p[0], p[1], p[2], turn[3], turn[4], turn[5]))
    if tau < 1.0:
        error = screw.from_twist(screw.scaled(screw.twist_along(error), tau))
    joint_velocity(work, q, error, qdot)
    return FOLLOWING


@kernel
def _roll_out(work, path, q, dt, pursuit_state, qdot, trace):
    """Follow the whole path from q, which is moved along; status, ticks, smallest joint margin."""
    margin = np.inf
    for count in range(len(trace)):
        for i in range(len(q)):
            trace[count, i] = q[i]
            margin = min(margin, q[i] - work[LIMITS, i], work[LIMITS + 1, i] - q[i])
        status = pursue(work, path, q, dt, pursuit_state, qdot)
        if status != FOLLOWING:
            return status, count, margin
        for i in range(len(q)):
            q[i] += dt * qdot[i]
    return FOLLOWING, len(trace) - 1, margin


class Pursuit:
    """A path being followed by an arm, tick by tick, on joints that the caller integrates or measures."""

    def __init__(
        self,
        arm: Arm,
        path: PosePath,
        dt: float,
        *,
        controller: ControllerSettings | None = None,
        settings: PursuitSettings | None = None,
    ):
        self.arm, self.path, self.dt = arm, path, dt
        controller = controller or ControllerSettings()
        if not 0 < controller.gain * dt <= 1:
            raise BadOption("gain", f"gain * dt = {controller.gain * dt:g} is not in (0, 1]")
        self._work = arm_arrays(arm, controller.packed(), (settings or PursuitSettings()).packed())
        self._pursuit_state = fresh_pursuit_state()

    @property
    def index(self) -> int:
        """Index of the reference in the path."""
        return int(self._pursuit_state[INDEX])

    def step(self, q: ArrayLike) -> tuple[int, np.ndarray]:
        """Status (FOLLOWING, ARRIVED or STALLED) and joint speeds (dof,) at joints q (dof,)."""
        qdot = np.empty(self.arm.dof)
        q = np.ascontiguousarray(q, dtype=np.float64)
        return pursue(self._work, self.path.dqs, q, self.dt, self._pursuit_state, qdot), qdot

    def roll_out(self, q: ArrayLike, max_seconds: float = 60.0) -> RollOut:
        """Follow the whole path with ideal tracking; the pursuit itself is unchanged."""
        q = np.array(q, dtype=np.float64)
        trace = np.empty((round(max_seconds / self.dt) + 1, self.arm.dof))
        pursuit_state, qdot = np.array([0.0, 0.0, np.inf, 0.0]), np.empty(self.arm.dof)
        status, ticks, margin = _roll_out(self._work, self.path.dqs, q, self.dt, pursuit_state, qdot, trace)
        reason = {ARRIVED: "", STALLED: "ik_or_limit", FOLLOWING: "timeout"}[status]
        return RollOut(status == ARRIVED, reason, q, ticks * self.dt, margin, trace[: ticks + 1])
