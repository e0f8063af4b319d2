"""The rules of pouring: where the beads are, success, wanted contacts, dense reward, from the simulator's state only.

The numbers are judged in compiled code, see `state`; `PourProgress` keeps what they came to.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...planner.geometry import screw
from ...planner.jit import kernel
from ..core.progress import Progress
from ..scene.scene import ARM, BEAD, FINGERS, FIRST_OBJECT, FURNITURE, OTHER_ARM, OTHER_FINGERS
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State
from .geometry import SOURCE, TARGET

ENOUGH, SPILLED = 0.9, 0.05
"""Least share of the beads in the target, and largest share outside both glasses, of a success."""
UPRIGHT = np.deg2rad(10.0)
"""Largest tilt of a target that stands [rad]."""
STILL = 0.01
"""A glass slower than this stands [m/s]."""
LIFTED = 0.02
"""Height above its start at which the source counts as lifted [m]."""
ARRIVED = 0.15
"""Horizontal distance of the source's rim to the target's axis at which the carry ends and the pouring begins [m]."""
HOME = 0.06
"""Distance in the plane [m] from where it stood up to which the source may touch its stand."""
LYING = TABLE_HEIGHT + 0.03
"""A bead lower than this cannot come into a glass any more [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""A glass whose center is below this has fallen off the table [m]."""
TOPPLED = np.deg2rad(45.0)
"""Tilt from which on a source that was let go has been dropped [rad]."""
X, Y, Z, WAS_LIFTED, WAS_THERE, TILT, LOST = range(7)
"""The memory: where the source was at the start; 1 once it was lifted, and once it came to the target; its largest
tilt [rad] and the most beads outside both glasses on the way between."""


class PourVerdict(NamedTuple):
    """What the compiled judge says of a state; counts and flags as whole numbers.

    Attributes:
        source: beads in the source.
        target: beads in the target.
        lying: beads that are out for good.
        held: the source is in the hand.
        done: enough beads are in the target, and it stands.
        dropped: the source was lifted, let go and has toppled.
        fallen: a glass is off the table.
        unwanted: pairs that touch and should not.
        low: the smaller owner of the last of them, or -1.
        high: the other owner.
    """

    source: int
    target: int
    lying: int
    held: int
    done: int
    dropped: int
    fallen: int
    unwanted: int
    low: int
    high: int


@kernel
def beads_inside(pose, radius, height, beads):
    """How many of the beads (n, 3) are within a glass (7,), filled up, of a radius and a height [m]."""
    back, count = (pose[3], -pose[4], -pose[5], -pose[6]), 0
    for k in range(len(beads)):
        away = (beads[k, 0] - pose[0], beads[k, 1] - pose[1], beads[k, 2] - pose[2])
        x, y, z = screw.rotate(back, away)
        count += abs(z) <= 0.5 * height and math.hypot(x, y) <= radius
    return count


@kernel
def tilt_of(pose):
    """Angle of the z axis of a pose (7,) to the vertical [rad]."""
    return 2.0 * math.atan2(math.hypot(pose[4], pose[5]), math.hypot(pose[3], pose[6]))


@kernel
def allowed_contact(low, high, at_home):
    """Whether two owners may touch: see WORLD in `scene` for their numbers, the smaller first.

    Wanted are the fingers on the source, those of a second arm on the target, the source on its stand as long as it
    is there, and the target on its own. Beads may touch anything: where they end is judged by itself. A robot's
    contact with itself says nothing.
    """
    if low in (high, BEAD) or high == BEAD or (low == ARM and high == FINGERS):
        return True
    if low == OTHER_ARM and high == OTHER_FINGERS:
        return True
    if low == FINGERS:
        return high == FIRST_OBJECT + SOURCE
    if low == OTHER_FINGERS:
        return high == FIRST_OBJECT + TARGET
    if low == FURNITURE:
        return high == FIRST_OBJECT + TARGET or (at_home and high == FIRST_OBJECT + SOURCE)
    return False


@kernel
def rim_gap(pose, height, other):
    """Horizontal distance [m] of the middle of a glass's rim to another glass's axis."""
    x, y, _ = screw.rotate((pose[3], pose[4], pose[5], pose[6]), (0.0, 0.0, 0.5 * height))
    return math.hypot(pose[0] + x - other[0], pose[1] + y - other[1])


@kernel
def judge_state(poses, velocities, beads, touching, sizes, memory):
    """Judge a state: the entries of a `PourVerdict`.

    Args:
        poses: (2, 7) source and target.
        velocities: (2, 3) of them [m/s].
        beads: (n, 3) places of the beads [m].
        touching: (owners, owners) who touches whom, see `State`.
        sizes: (2, 2) radius and height [m] of both glasses.
        memory: (7,) see X; renewed.
    """
    n, source, target = len(beads), poses[SOURCE], poses[TARGET]
    inside = beads_inside(source, sizes[SOURCE, 0], sizes[SOURCE, 1], beads)
    poured = beads_inside(target, sizes[TARGET, 0], sizes[TARGET, 1], beads)
    lying = 0
    for k in range(n):
        lying += beads[k, 2] < LYING
    held = touching[FINGERS, FIRST_OBJECT + SOURCE] != 0.0
    if held and source[2] > memory[Z] + LIFTED:
        memory[WAS_LIFTED] = 1.0
    if memory[WAS_LIFTED] != 0.0 and rim_gap(source, sizes[SOURCE, 1], target) < ARRIVED:
        memory[WAS_THERE] = 1.0
    if memory[WAS_LIFTED] != 0.0 and memory[WAS_THERE] == 0.0:
        memory[TILT] = max(memory[TILT], tilt_of(source))
        memory[LOST] = max(memory[LOST], n - inside - poured)
    moving = math.sqrt(velocities[TARGET, 0] ** 2 + velocities[TARGET, 1] ** 2 + velocities[TARGET, 2] ** 2)
    stands = tilt_of(target) < UPRIGHT and moving < STILL
    done = stands and poured >= ENOUGH * n and n - inside - poured <= SPILLED * n
    dropped = memory[WAS_LIFTED] != 0.0 and not held and tilt_of(source) > TOPPLED
    fallen = source[2] < LOWEST or target[2] < LOWEST
    at_home = math.hypot(source[0] - memory[X], source[1] - memory[Y]) < HOME
    unwanted, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            if touching[a, b] != 0.0 and not allowed_contact(a, b, at_home):
                unwanted, low, high = unwanted + 1, a, b
    return inside, poured, lying, int(held), int(done), int(dropped), int(fallen), unwanted, low, high


class PourProgress(Progress):
    """What has happened in an episode so far, renewed from the simulator's state at each step.

    Args:
        start: (2, 7) source and target at the start.
        sizes: (2, 2) radius and height [m] of both glasses.
        beads: how many there are.
        dt: seconds between states.
        in_hand: there is no stand to lift the source from.
    """

    def __init__(self, start: np.ndarray, sizes: np.ndarray, beads: int, dt: float, *, in_hand: bool = False):
        super().__init__(dt)
        self.count, self._sizes = beads, sizes
        self._memory = np.concatenate([start[SOURCE, :3], [float(in_hand)], np.zeros(3)])
        self.verdict = PourVerdict(beads, 0, 0, 0, 0, 0, 0, 0, -1, -1)

    @property
    def failed(self) -> bool:
        """Nothing that can be done would be a success any more."""
        return self.verdict.fallen == 1 or self.verdict.lying > SPILLED * self.count

    @property
    def motion_index(self) -> float:
        """0 while the source is to be fetched, 1 while it is in the hand, 2 once enough beads are in the target."""
        return 2.0 if self.verdict.done else float(self.verdict.held)

    @property
    def fractions(self) -> np.ndarray:
        """(3,) share of the beads in the source, in the target, and outside both."""
        source, target = self.verdict.source, self.verdict.target
        return np.array([source, target, self.count - source - target]) / self.count

    @property
    def stage(self) -> str:
        """The furthest progress in words."""
        if self.verdict.target:
            return f"poured {self.verdict.target} of {self.count}"
        if self._memory[WAS_THERE]:
            return "at the target"
        return "lifted the source" if self._memory[WAS_LIFTED] else "start"

    @property
    def failure(self) -> str:
        """Why it cannot succeed as things are, "" if it can, or did."""
        if self.success:
            return ""
        if self.verdict.fallen:
            return "off_table"
        if self.verdict.dropped:
            return "dropped"
        return "constraint" if self.verdict.lying > SPILLED * self.count else ""

    def update(self, state: State) -> PourVerdict:
        """Take in a new state."""
        poses, moving, beads = state.object_pose, state.object_velocity, state.bead_position
        self.verdict = PourVerdict(*judge_state(poses, moving, beads, state.touching, self._sizes, self._memory))
        self._settle(self.verdict.done == 1, self.verdict)
        return self.verdict

    def reward(self, state: State) -> float:
        """The dense reward in [0, 1] of the state taken in last: reached, held, carried, poured."""
        if self.success:
            return 1.0
        source, target = state.object_pose
        reach = 1.0 - math.tanh(5.0 * math.dist(state.tcp_pose[0, :3], source[:3]))
        distance = rim_gap(source, self._sizes[SOURCE, 1], target)
        carry = 1.0 - math.tanh(5.0 * max(0.0, distance - ARRIVED)) if self.verdict.held else 0.0
        poured = self.verdict.target / self.count
        return max(0.1 * reach + 0.1 * self.verdict.held + 0.2 * carry, 0.4 * (poured > 0.0)) + 0.5 * poured

    def task_info(self) -> dict[str, Any]:
        """The task's own entries of `info`."""
        _, target, outside = self.fractions
        return {
            "fraction_in_target": float(target),
            "fraction_outside": float(outside),
            "carry_tilt": float(self._memory[TILT]),
            "beads_lost": int(self._memory[LOST]),
        }
