"""The safety layer: any command in, a command out that keeps the distance to what is known.

First the nearest joint speeds that keep the bounds of `barrier`. Then the guard: a step is taken only if it surely
stays clear, also between its ends; else half of it, a quarter and so on, at last none. For obstacles that stand still
and exact kinematics this is a guarantee, whatever the command (method reference section 7). Where something comes
faster than the arm can retreat, it does the best it can and says BLOCKED.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..collision.clearance import (
    find_near,
    min_slack,
    near_pair_slack,
    placed_step_stays_clear,
    reach_of,
    step_stays_clear,
)
from ..collision.robot_arrays import (
    HEADER,
    LEVERS,
    N_NEAR,
    NEXT,
    PREVIOUS,
    SEEN,
    SEEN_COUNTS,
    SEEN_MOVING,
    SEEN_ROOM,
    SETTINGS,
    STEP,
    WISH,
    WORLD,
    place_capsules,
    robot_arrays,
)
from ..errors import BadOption, BadShape, UnknownName
from ..geometry.shapes import Obstacle, pack
from ..jit import inner, kernel
from ..robot.arm import Arm
from ..robot.body import Body
from .barrier import DECAY, HALVINGS, SHELL, clip_to_limits, constrain, exceeds_limits, scale_to_speeds

FREE, CHANGED, HELD, BLOCKED = 0, 1, 2, 3
"""The command is as it was; it was changed; it was shortened by the guard; what must hold cannot hold.

BLOCKED says to the caller: the command is the best there is, but no promise of distance goes with it. Among obstacles
that stand still it comes too where a cornered robot has less room than the buffer (0.8 % of adversarial steps): the
bounds ask for a retreat that there is none of, the guard's step, mostly none at all, is still proven clear, and to go
on commanding is safe. Where something moves, it comes closer than it may: stop what brings it, if you can.
"""


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """Distances and rates of the safety layer.

    Attributes:
        distance: to keep between body and obstacles [m], where an obstacle has no margin of its own. The measured
            tracking error of the arm belongs in it.
        self_distance: to keep between parts of the robot [m].
        shell: distance [m] below which a pair is looked at.
        alpha: approach is at most this times the room that is left [1/s].
        buffer: room [m] that the bounds leave over, so that motion along a surface is not stopped by rounding.
        decay: the guard takes a step only if it leaves at least 1 - decay of the room.
        halvings: how often the guard halves a step before it takes none.
        limit_gain: approach to a joint limit is at most this times the distance to it [1/s].
        rotation_weight: of the tools' turning against their moving, in what "nearest speeds" means [m^2].
        rest_weight: of a joint's own motion [m^2].
        acceleration: largest change of a joint's speed [rad/s^2] that the bounds ask for, for arms that are not
            ideal; stopping in the guard is not bound by it.
        lead: seconds that moving obstacles are looked at ahead of time, for arms that lag.
    """

    distance: float = 0.01
    self_distance: float = 0.01
    shell: float = 0.06
    alpha: float = 6.0
    buffer: float = 2e-4
    decay: float = 0.5
    halvings: int = 8
    limit_gain: float = 20.0
    rotation_weight: float = 0.04
    rest_weight: float = 0.01
    acceleration: float = 1e6
    lead: float = 0.0

    def __post_init__(self):
        for name in ("alpha", "shell", "limit_gain", "rotation_weight", "rest_weight", "acceleration"):
            if not 0 < getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")
        for name in ("distance", "self_distance", "buffer", "lead"):
            if not 0 <= getattr(self, name) < math.inf:
                raise BadOption(name, f"{getattr(self, name)} is not a number >= 0")
        if not 0 < self.decay <= 1:
            raise BadOption("decay", f"{self.decay} is not in (0, 1]")
        if not 1 <= self.halvings <= 30:
            raise BadOption("halvings", f"{self.halvings} is not from 1 to 30")
        if self.shell <= max(self.distance, self.self_distance):
            raise BadOption("shell", f"{self.shell} is not above the distance to keep, {self.distance}")

    def packed(self, dt: float) -> tuple[float, ...]:
        """The settings as the kernels take them, for commands that are held for dt seconds."""
        limit_gain = min(self.limit_gain, 1.0 / dt)  # no farther than to the limit in one step
        rates = (self.shell, self.alpha, self.buffer, limit_gain, self.rotation_weight, self.rest_weight)
        return (*rates, self.decay, float(self.halvings), self.acceleration * dt, 0.0, self.self_distance)


@inner
def _backtracked(g, q, x, dt):
    """Shorten the speeds x (n,) until a step of dt seconds from q (n,) surely stays clear; the status.

    Where none does, the one of all that leaves most room is taken. Near pairs as found at q, capsules at WORLD.
    """
    n, step, halvings = len(q), g[STEP], int(g[SETTINGS, HALVINGS])
    for i in range(n):
        step[i] = x[i] * dt
    reach = reach_of(g, step, dt)
    if reach > g[SETTINGS, SHELL]:
        find_near(g, reach)
    if int(g[HEADER, N_NEAR]) == 0:
        return FREE
    slack, scale, best, best_room = near_pair_slack(g, -1, 0.0), 1.0, 0.0, -math.inf
    for k in range(halvings + 1):
        if k == halvings:
            scale = 0.0
        for i in range(n):
            step[i] = scale * x[i] * dt
            g[WISH, i] = q[i] + step[i]
        place_capsules(g, g[WISH, :n], NEXT)
        after = near_pair_slack(g, NEXT, dt)
        if after > best_room:
            best, best_room = scale, after
        gentle = slack <= 0.0 or after >= (1.0 - g[SETTINGS, DECAY]) * slack
        # the whole step is placed already, its ways are bound: mostly there is no need to look at parts of it
        whole = k == 0 and placed_step_stays_clear(g, step[:n], 0.0, dt)
        if gentle and (whole or step_stays_clear(g, q, step[:n], dt)):
            for i in range(n):
                x[i] *= scale
            return FREE if scale == 1.0 else HELD
        scale *= 0.5
    for i in range(n):
        x[i] *= best
    return BLOCKED


@inner
def _all_far(g, q, x, dt):
    """True if at the last look everything was so far that nothing can be close now, nor during this step."""
    if g[SEEN, SEEN_COUNTS] == 0.0 or g[SEEN, SEEN_MOVING] == 1.0:
        return False
    displacement = 0.0
    for i in range(len(q)):
        displacement += g[LEVERS, i] * (abs(q[i] - g[SEEN, i]) + abs(x[i]) * dt)
    # two parts of the robot may both move
    return g[SEEN, SEEN_ROOM] - 2.0 * displacement > g[SETTINGS, SHELL]


@inner
def _look(g, q):
    """Find the near pairs at q; where there are none, remember how far everything is."""
    place_capsules(g, q, WORLD)
    find_near(g, g[SETTINGS, SHELL])
    g[SEEN, SEEN_COUNTS] = 0.0
    if int(g[HEADER, N_NEAR]) == 0:
        g[SEEN, SEEN_ROOM], g[SEEN, SEEN_COUNTS] = min_slack(g, WORLD, 0.0, 1.0), 1.0
        for i in range(len(q)):
            g[SEEN, i] = q[i]


@kernel
def safe_velocity(g, q, qdot, dt, out):
    """Joint speeds near the wanted ones that keep clear; the status (FREE, CHANGED, HELD or BLOCKED).

    Args:
        g: see `robot_arrays`.
        q: (n,) joints of all arms.
        qdot: (n,) wanted speeds, any numbers whatever.
        dt: seconds that they will be held.
        out: (n,) result.
    """
    n = len(q)
    for i in range(n):
        out[i] = qdot[i] if math.isfinite(qdot[i]) else 0.0
    scale_to_speeds(g, out)
    missed, far = False, _all_far(g, q, out, dt)
    if far:
        g[HEADER, N_NEAR] = 0
    else:
        _look(g, q)
    if int(g[HEADER, N_NEAR]) > 0 or exceeds_limits(g, q, out):
        missed = constrain(g, q, out)
    clip_to_limits(g, q, out)
    status = FREE
    for i in range(n):
        if out[i] != qdot[i]:
            status = CHANGED
    # bounds change speeds by no more than the slew, and only where something is near or a limit is
    if not (far and _all_far(g, q, out, dt)):
        if far:
            _look(g, q)
        status = max(status, _backtracked(g, q, out, dt))
    for i in range(n):
        g[PREVIOUS, i] = out[i]
    return BLOCKED if missed else status


class Filtered(NamedTuple):
    """A command after the safety layer.

    Attributes:
        velocity: (n,) joint speeds [rad/s or m/s].
        status: FREE, CHANGED, HELD or BLOCKED.
        slack: smallest distance of a close pair less what it must keep, before the step [m]; inf if none is close.
    """

    velocity: np.ndarray
    status: int
    slack: float

    @property
    def blocked(self) -> bool:
        """What must hold cannot hold: something comes faster than the robot can retreat."""
        return self.status == BLOCKED


class SafetyLayer:
    """The safety layer of a robot, one arm or two, among obstacles.

    Args:
        arms: the arms.
        bodies: their bodies, held objects included, in the same order.
        obstacles: what is around; moving ones with their velocity.
        dt: seconds that a command is held.
        settings: see `SafetySettings`.
        allowed: pairs of names (of a body's capsule or held object, of an obstacle) that may touch.
        pairs: capsules, counted through all bodies, that may hit each other; see `body_pairs`.
    """

    def __init__(
        self,
        arms: Sequence[Arm],
        bodies: Sequence[Body],
        obstacles: Sequence[Obstacle],
        dt: float,
        *,
        settings: SafetySettings | None = None,
        allowed: Sequence[tuple[str, str]] = (),
        pairs: Sequence[tuple[int, int]] = (),
    ):
        self.settings, self.dt = settings or SafetySettings(), float(dt)
        self.joints = sum(arm.dof for arm in arms)
        if not 0 < self.dt < math.inf:
            raise BadOption("dt", f"{dt} is not a positive number of seconds")
        seen = [obstacle.at(self.settings.lead) for obstacle in obstacles]
        self.work = robot_arrays(
            arms,
            bodies,
            pack(seen),
            masks=contact_masks([name for body in bodies for name in body.names], obstacles, allowed),
            margin=self.settings.distance,
            pairs=pairs,
            settings=self.settings.packed(self.dt),
        )

    def __call__(self, q: ArrayLike, velocity: ArrayLike) -> Filtered:
        """A safe command near the wanted one.

        Args:
            q: (n,) joints now, arm after arm.
            velocity: (n,) wanted joint speeds; not finite ones count as 0.
        """
        joints, wanted = self._checked("q", q), self._checked("velocity", velocity)
        if not np.isfinite(joints).all():
            raise BadOption("q", f"joint {int(np.argmin(np.isfinite(joints)))} is not finite")
        out = np.empty(self.joints)
        status = safe_velocity(self.work, joints, wanted, self.dt, out)
        return Filtered(out, int(status), float(near_pair_slack(self.work, -1, 0.0)))

    def _checked(self, name: str, value: ArrayLike) -> np.ndarray:
        array = np.ascontiguousarray(value, dtype=np.float64)
        if array.shape != (self.joints,):
            raise BadShape(f"safety: {name}", array.shape, f"({self.joints},)")
        return array


def contact_masks(names: Sequence[str], obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]]) -> list[int]:
    """Per obstacle the capsules, as bits of a number, that may touch it.

    Args:
        names: whose each capsule is.
        obstacles: the obstacles.
        allowed: pairs of a name of a capsule and the name of an obstacle.

    Raises:
        UnknownName: no capsule or no obstacle has such a name.
    """
    known: Mapping[str, None] = dict.fromkeys(obstacle.name for obstacle in obstacles)
    for capsule, obstacle in allowed:
        if capsule not in names:
            raise UnknownName("part of the body", capsule, dict.fromkeys(names))
        if obstacle not in known:
            raise UnknownName("obstacle", obstacle, known)
    pairs = set(allowed)
    return [sum(1 << k for k, name in enumerate(names) if (name, obstacle.name) in pairs) for obstacle in obstacles]
