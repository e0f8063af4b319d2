"""The safety layer: it turns any command into one that keeps the margins to all known obstacles.

First come the nearest joint speeds that satisfy the bounds of `barrier`. Then the guard: a step is taken only if it
surely stays clear, also between its ends; else half of it, a quarter and so on, in the end no step at all. For
standing obstacles and exact kinematics this is a guarantee, whatever the command (method reference section 7). If an
obstacle approaches faster than the arm can retreat, the layer sends the best command there is and reports BLOCKED.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_array, checked_items, checked_settings, is_fit
from ..collision.capsule_placement import place_capsules
from ..collision.clearance import find_near, min_slack
from ..collision.robot_arrays import HEADER, LAST_LOOK, ROW, SETTING, robot_arrays
from ..collision.step_certificates import near_pair_slack, placed_step_stays_clear, reach_of, step_stays_clear
from ..columns import packed_row
from ..errors import BadOption
from ..geometry.shapes import Obstacle, pack
from ..jit import inner, kernel
from ..ranges import check_range, check_ranges
from ..robot.arm import Arm
from ..robot.body import Body
from .barrier import clip_to_limits, constrain, exceeds_limits, scale_to_speeds
from .robot_checks import check_bodies, checked_pairs, contact_masks

FREE, CHANGED, HELD, BLOCKED = 0, 1, 2, 3
"""Status of a command: unchanged; changed by the bounds; shortened by the guard; the constraints are infeasible.

BLOCKED means that the command is the best there is, without a guaranteed distance. Among standing obstacles a cornered
robot with less slack than the buffer gets it too (0.8 % of adversarial steps): the bounds ask for a retreat that does
not exist; the guard's step, mostly none at all, is still proven clear, so to continue is safe. If an obstacle moves, it
comes within its margin: stop whatever moves it, if you can.
"""


@dataclass(frozen=True, slots=True)
class SafetySettings:
    """Distances and rates of the safety layer.

    Attributes:
        distance: margin [m] between body and obstacles, for obstacles without a margin of their own. It must
            include the measured tracking error of the arm.
        self_distance: margin [m] between parts of the robot.
        shell: distance [m] below which a pair is near and gets a bound.
        alpha: largest approach per slack [1/s].
        buffer: slack [m] that the bounds leave, so that rounding does not stop a motion along a surface.
        decay: the guard takes a step only if it leaves at least 1 - decay of the slack.
        halvings: number of times the guard halves a step before it takes none.
        limit_gain: largest approach to a joint limit per distance to the limit [1/s].
        rotation_weight: weight of the tools' rotation against their translation in the metric of speeds [m^2].
        rest_weight: weight of every joint's own motion [m^2].
        acceleration: largest change of a joint's speed [rad/s^2] that the bounds ask for, for arms that are not
            ideal; a stop by the guard is exempt.
        lead: time [s] by which moving obstacles are predicted, for arms that lag.
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
        check_ranges(self, "(0, inf)", "alpha", "shell", "limit_gain", "rotation_weight", "rest_weight", "acceleration")
        check_ranges(self, "[0, inf)", "distance", "self_distance", "buffer", "lead")
        check_ranges(self, "(0, 1]", "decay")
        check_ranges(self, "[1, 30]", "halvings")
        if self.shell <= max(self.distance, self.self_distance):
            raise BadOption("shell", f"{self.shell} is not above the distance to keep, {self.distance}")

    def packed(self, dt: float) -> np.ndarray:
        """Return the settings as the kernels take them (see `robot_arrays.SETTING`), for commands held for dt [s]."""
        return packed_row(
            SETTING,
            shell=self.shell,
            alpha=self.alpha,
            buffer=self.buffer,
            limit_gain=min(self.limit_gain, 1.0 / dt),  # no farther than to the limit in one step
            rotation_weight=self.rotation_weight,
            rest_weight=self.rest_weight,
            decay=self.decay,
            halvings=self.halvings,
            slew=self.acceleration * dt,
            self_margin=self.self_distance,
        )


@inner
def _backtracked(g, q, x, dt):
    """Shorten the speeds x (n,) until a step of dt seconds from q (n,) surely stays clear; returns the status.

    If no length does, the one that leaves most slack is taken. The near pairs were found at q, and the capsules
    placed at ROW.placed.
    """
    n, step, halvings = len(q), g[ROW.step], int(g[ROW.settings, SETTING.halvings])
    for i in range(n):
        step[i] = x[i] * dt
    reach = reach_of(g, step, dt)
    if reach > g[ROW.settings, SETTING.shell]:
        find_near(g, reach)
    if int(g[ROW.header, HEADER.near]) == 0:
        return FREE
    slack, scale, best, best_slack = near_pair_slack(g, -1, 0.0), 1.0, 0.0, -math.inf
    for k in range(halvings + 1):
        if k == halvings:
            scale = 0.0
        for i in range(n):
            step[i] = scale * x[i] * dt
            g[ROW.stepped, i] = q[i] + step[i]
        place_capsules(g, g[ROW.stepped, :n], ROW.placed_next)
        after = near_pair_slack(g, ROW.placed_next, dt)
        if after > best_slack:
            best, best_slack = scale, after
        gentle = slack <= 0.0 or after >= (1.0 - g[ROW.settings, SETTING.decay]) * slack
        # the whole step is placed and its displacements are bounded: mostly its parts need no check
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
    """True if at the last look all pairs were so far that none can be near now or during this step."""
    if g[ROW.last_look, LAST_LOOK.valid] == 0.0 or g[ROW.last_look, LAST_LOOK.moving] == 1.0:
        return False
    displacement = 0.0
    for i in range(len(q)):
        displacement += g[ROW.levers, i] * (abs(q[i] - g[ROW.last_look, i]) + abs(x[i]) * dt)
    # both capsules of a pair may move
    return g[ROW.last_look, LAST_LOOK.slack] - 2.0 * displacement > g[ROW.settings, SETTING.shell]


@inner
def _look(g, q):
    """Find the near pairs at q; if there are none, remember the slack of all pairs."""
    place_capsules(g, q, ROW.placed)
    find_near(g, g[ROW.settings, SETTING.shell])
    g[ROW.last_look, LAST_LOOK.valid] = 0.0
    if int(g[ROW.header, HEADER.near]) == 0:
        g[ROW.last_look, LAST_LOOK.slack] = min_slack(g, ROW.placed, 0.0, 1.0)
        g[ROW.last_look, LAST_LOOK.valid] = 1.0
        for i in range(len(q)):
            g[ROW.last_look, i] = q[i]


@kernel
def safe_velocity(g, q, qdot, dt, out):
    """Compute joint speeds near the wanted ones that keep clear.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        qdot: (n,) wanted speeds, any numbers whatever.
        dt: time for which the speeds will be held [s].
        out: (n,) result.

    Returns:
        The status: FREE, CHANGED, HELD or BLOCKED.
    """
    n = len(q)
    for i in range(n):
        out[i] = qdot[i] if math.isfinite(qdot[i]) else 0.0
    scale_to_speeds(g, out)
    missed, far = False, _all_far(g, q, out, dt)
    if far:
        g[ROW.header, HEADER.near] = 0
    else:
        _look(g, q)
    if int(g[ROW.header, HEADER.near]) > 0 or exceeds_limits(g, q, out):
        missed = constrain(g, q, out)
    clip_to_limits(g, q, out)
    status = FREE
    for i in range(n):
        if out[i] != qdot[i]:
            status = CHANGED
    # the bounds change speeds by at most the slew, and only near an obstacle or a limit
    if not (far and _all_far(g, q, out, dt)):
        if far:
            _look(g, q)
        status = max(status, _backtracked(g, q, out, dt))
    for i in range(n):
        g[ROW.previous, i] = out[i]
    return BLOCKED if missed else status


class Filtered(NamedTuple):
    """A command filtered by the safety layer.

    Attributes:
        velocity: (n,) joint speeds [rad/s or m/s].
        status: FREE, CHANGED, HELD or BLOCKED.
        slack: smallest slack [m] of the near pairs before the step; inf without any.
    """

    velocity: np.ndarray
    status: int
    slack: float

    @property
    def blocked(self) -> bool:
        """True if the constraints are infeasible: an obstacle comes faster than the robot can retreat."""
        return self.status == BLOCKED


class SafetyLayer:
    """The safety layer of a robot, one arm or two, among obstacles.

    Args:
        arms: the arms.
        bodies: their bodies, held objects included, in the same order.
        obstacles: all known obstacles; moving ones with their velocity.
        dt: time for which a command is held [s].
        settings: see `SafetySettings`.
        allowed: pairs of names (of a body's capsule or held object, of an obstacle) that may touch.
        pairs: capsules, counted through all bodies, that may hit each other; see `body_pairs`.

    Raises:
        WrongType, BadShape: an argument is of a wrong class or shape.
        BadModel: a body does not belong to its arm.
        BadOption: dt is no positive number, a pair names a capsule that there is not, or there are too many arms.
        UnknownName: `allowed` names a part or an obstacle that does not exist.
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
        check_range("dt", dt, "(0, inf)")
        self.settings, self.dt = checked_settings(SafetySettings, settings), float(dt)
        arms, bodies = checked_items("arms", arms, Arm), checked_items("bodies", bodies, Body)
        check_bodies(arms, bodies)
        obstacles = checked_items("obstacles", obstacles, Obstacle)
        self.joints = sum(arm.dof for arm in arms)
        seen = [obstacle.at(self.settings.lead) for obstacle in obstacles]
        self.work = robot_arrays(
            arms,
            bodies,
            pack(seen),
            masks=contact_masks([name for body in bodies for name in body.names], obstacles, allowed),
            margin=self.settings.distance,
            pairs=checked_pairs(pairs, sum(len(body) for body in bodies)),
            settings=self.settings.packed(self.dt),
        )

    def __call__(self, q: ArrayLike, velocity: ArrayLike) -> Filtered:
        """Return a safe command near the wanted one.

        Args:
            q: (n,) joints now, arm after arm.
            velocity: (n,) wanted joint speeds [rad/s or m/s]; speeds that are not finite count as 0.

        Raises:
            WrongType, BadShape, NotFinite: not (n,) numbers, or joints that are not finite.
        """
        shape = (self.joints,)
        joints = q if is_fit(q, shape) else checked_array("safety: q", q, shape)
        # a speed that is not finite counts as 0, see `safe_velocity`
        wanted = checked_array("safety: velocity", velocity, shape, finite=False)
        out = np.empty(self.joints)
        status = safe_velocity(self.work, joints, wanted, self.dt, out)
        return Filtered(out, int(status), float(near_pair_slack(self.work, -1, 0.0)))
