"""Rules of pouring: bead counts, success, wanted contacts, dense reward, from the simulator's state only.

Compiled code judges the numbers, see `state`; `PourProgress` keeps the results.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from ...planner.geometry import screw
from ...planner.jit import kernel
from ..judge.dense_reward import tilting
from ..judge.goal_progress import contacts
from ..judge.judge import unwanted_contacts
from ..judge.progress import Progress
from ..scene.scene import BEAD, FINGERS, FIRST_OBJECT, FURNITURE, OTHER_FINGERS
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State
from .facts import SOURCE, TARGET
from .geometry import TILTED

ENOUGH, SPILLED = 0.9, 0.05
"""Least share of the beads in the target, and largest share outside both glasses, for success."""
UPRIGHT = np.deg2rad(10.0)
"""Largest tilt at which the target counts as upright [rad]."""
STILL = 0.01
"""Speed below which a glass counts as at rest [m/s]."""
LIFTED = 0.02
"""Height above its start from which the source counts as lifted [m]."""
ARRIVED = 0.15
"""Horizontal distance of the source's rim to the target's axis at which the carry ends and the pouring starts [m]."""
HOME = 0.06
"""Horizontal distance [m] from its initial place within which the source may touch its stand."""
LYING = TABLE_HEIGHT + 0.03
"""Height (z) below which a bead can no longer get into a glass [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""Height (z) of a glass's center below which the glass has fallen off the table [m]."""
TOPPLED = np.deg2rad(45.0)
"""Tilt from which a lifted and released source counts as dropped [rad]."""


class MemoryPlaces(NamedTuple):
    """Places of the numbers that the judge of pouring remembers."""

    x: int = 0  # initial position of the source [m]
    y: int = 1
    z: int = 2
    was_lifted: int = 3  # 1 once the source was lifted
    was_there: int = 4  # 1 once the source reached the target
    tilt: int = 5  # largest tilt [rad] of the source in between
    lost: int = 6  # most beads outside both glasses in between
    width: int = 7


MEMORY = MemoryPlaces()


class PourVerdict(NamedTuple):
    """Verdict of the compiled judge on a state; counts and flags are whole numbers.

    Attributes:
        source: number of beads in the source.
        target: number of beads in the target.
        lying: number of beads lost for good.
        held: whether the source is in the hand.
        done: whether enough beads are in the target, and it is upright and at rest.
        dropped: whether the source was lifted and released, and has toppled.
        fallen: whether a glass is off the table.
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
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
    """Return the number of beads within a glass, taken as a solid cylinder.

    Args:
        pose: (7,) pose of the glass, x y z [m] and wxyz.
        radius: radius of the glass [m].
        height: height of the glass [m].
        beads: (n, 3) positions of the beads [m].
    """
    back, count = (pose[3], -pose[4], -pose[5], -pose[6]), 0
    for k in range(len(beads)):
        away = (beads[k, 0] - pose[0], beads[k, 1] - pose[1], beads[k, 2] - pose[2])
        x, y, z = screw.rotate(back, away)
        count += abs(z) <= 0.5 * height and math.hypot(x, y) <= radius
    return count


@kernel
def tilt_of(pose):
    """Return the angle of a pose's (7,) z axis to the vertical [rad]."""
    return 2.0 * math.atan2(math.hypot(pose[4], pose[5]), math.hypot(pose[3], pose[6]))


@kernel
def rim_gap(pose, height, other):
    """Return the horizontal distance [m] from the center of a glass's rim to another glass's axis.

    Args:
        pose: (7,) pose of the glass, x y z [m] and wxyz.
        height: height of the glass [m].
        other: (7,) pose of the other glass.
    """
    x, y, _ = screw.rotate((pose[3], pose[4], pose[5], pose[6]), (0.0, 0.0, 0.5 * height))
    return math.hypot(pose[0] + x - other[0], pose[1] + y - other[1])


@kernel
def judge_beads(poses, velocities, beads, touching, sizes, allowed, memory):
    """Judge a state; return the entries of a `PourVerdict`.

    Args:
        poses: (2, 7) poses of source and target, x y z [m] and wxyz.
        velocities: (2, 3) velocities of source and target [m/s].
        beads: (n, 3) positions of the beads [m].
        touching: (owners, owners) contacts, see `State`.
        sizes: (2, 2) radius and height [m] of both glasses.
        allowed: (owners, owners) wanted contacts, see `pour_contacts`; updated for the source at its initial place.
        memory: (7,) see `MEMORY`; updated.
    """
    n, source, target = len(beads), poses[SOURCE], poses[TARGET]
    inside = beads_inside(source, sizes[SOURCE, 0], sizes[SOURCE, 1], beads)
    poured = beads_inside(target, sizes[TARGET, 0], sizes[TARGET, 1], beads)
    lying = 0
    for k in range(n):
        lying += beads[k, 2] < LYING
    held = touching[FINGERS, FIRST_OBJECT + SOURCE] != 0.0
    if held and source[2] > memory[MEMORY.z] + LIFTED:
        memory[MEMORY.was_lifted] = 1.0
    if memory[MEMORY.was_lifted] != 0.0 and rim_gap(source, sizes[SOURCE, 1], target) < ARRIVED:
        memory[MEMORY.was_there] = 1.0
    if memory[MEMORY.was_lifted] != 0.0 and memory[MEMORY.was_there] == 0.0:
        memory[MEMORY.tilt] = max(memory[MEMORY.tilt], tilt_of(source))
        memory[MEMORY.lost] = max(memory[MEMORY.lost], n - inside - poured)
    moving = math.sqrt(velocities[TARGET, 0] ** 2 + velocities[TARGET, 1] ** 2 + velocities[TARGET, 2] ** 2)
    stands = tilt_of(target) < UPRIGHT and moving < STILL
    done = stands and poured >= ENOUGH * n and n - inside - poured <= SPILLED * n
    dropped = memory[MEMORY.was_lifted] != 0.0 and not held and tilt_of(source) > TOPPLED
    fallen = source[2] < LOWEST or target[2] < LOWEST
    at_home = math.hypot(source[0] - memory[MEMORY.x], source[1] - memory[MEMORY.y]) < HOME
    allowed[FURNITURE, FIRST_OBJECT + SOURCE] = 1.0 if at_home else 0.0
    unwanted, low, high = unwanted_contacts(touching, allowed, -1)
    return inside, poured, lying, int(held), int(done), int(dropped), int(fallen), unwanted, low, high


def pour_contacts() -> np.ndarray:
    """Return the wanted contacts (owners, owners), the source away from its initial place.

    These are the fingers on the source, a second arm's fingers on the target, and the target on its stand; at its
    initial place, the source on its stand, too. Beads may touch anything: their final places are judged separately.
    """
    source, target = FIRST_OBJECT + SOURCE, FIRST_OBJECT + TARGET
    beads = [(min(each, BEAD), max(each, BEAD)) for each in range(target + 1)]
    return contacts(2, [(FINGERS, source), (OTHER_FINGERS, target), (FURNITURE, target), *beads])


class PourProgress(Progress):
    """Progress of pouring, updated from the simulator's state at each step.

    Args:
        start: (2, 7) poses of source and target at the start, x y z [m] and wxyz.
        sizes: (2, 2) radius and height [m] of both glasses.
        beads: number of beads.
        dt: time between states [s].
        in_hand: whether the source is in the hand from the start, off its stand.
        dense: function of progress and state that returns the dense reward before success; None: `poured_by_arm`.
    """

    def __init__(
        self,
        start: np.ndarray,
        sizes: np.ndarray,
        beads: int,
        dt: float,
        *,
        in_hand: bool = False,
        dense: Callable[[PourProgress, State], float] | None = None,
    ):
        super().__init__(dt)
        self.count, self.sizes, self._dense = beads, sizes, dense or poured_by_arm
        self._memory, self._allowed = np.zeros(MEMORY.width), pour_contacts()
        self._memory[MEMORY.x : MEMORY.z + 1], self._memory[MEMORY.was_lifted] = start[SOURCE, :3], float(in_hand)
        self.verdict = PourVerdict(beads, 0, 0, 0, 0, 0, 0, 0, -1, -1)

    @property
    def failed(self) -> bool:
        """True once a glass has fallen or too many beads are lost."""
        return self.verdict.fallen == 1 or self.verdict.lying > SPILLED * self.count

    @property
    def motion_index(self) -> float:
        """Index of the current motion: 0 while fetching the source, 1 while holding it, 2 once enough is poured."""
        return 2.0 if self.verdict.done else float(self.verdict.held)

    @property
    def fractions(self) -> np.ndarray:
        """(3,) shares of the beads in the source, in the target, and outside both."""
        source, target = self.verdict.source, self.verdict.target
        return np.array([source, target, self.count - source - target]) / self.count

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        if self.verdict.target:
            return f"poured {self.verdict.target} of {self.count}"
        if self._memory[MEMORY.was_there]:
            return "at the target"
        return "lifted the source" if self._memory[MEMORY.was_lifted] else "start"

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed at present, "" if it can or did."""
        if self.success:
            return ""
        if self.verdict.fallen:
            return "off_table"
        if self.verdict.dropped:
            return "dropped"
        return "constraint" if self.verdict.lying > SPILLED * self.count else ""

    def update(self, state: State) -> PourVerdict:
        """See `Progress`."""
        poses, moving, beads = state.object_pose, state.object_velocity, state.bead_position
        self.verdict = PourVerdict(
            *judge_beads(poses, moving, beads, state.touching, self.sizes, self._allowed, self._memory)
        )
        self._settle(self.verdict.done == 1, self.verdict)
        return self.verdict

    def reward(self, state: State) -> float:
        """See `Progress`."""
        return 1.0 if self.success else self._dense(self, state)

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        _, target, outside = self.fractions
        return {
            "fraction_in_target": float(target),
            "fraction_outside": float(outside),
            "carry_tilt": float(self._memory[MEMORY.tilt]),
            "beads_lost": int(self._memory[MEMORY.lost]),
        }


def poured_by_arm(progress: PourProgress, state: State) -> float:
    """Return the dense reward in [0, 1] for reaching, holding, carrying and pouring.

    Args:
        progress: of the episode.
        state: the state.
    """
    (source, target), held = state.object_pose, progress.verdict.held
    reach = 1.0 - math.tanh(5.0 * math.dist(state.tcp_pose[0, :3], source[:3]))
    distance = rim_gap(source, progress.sizes[SOURCE, 1], target)
    carry = 1.0 - math.tanh(5.0 * max(0.0, distance - ARRIVED)) if held else 0.0
    poured = progress.verdict.target / progress.count
    return max(0.1 * reach + 0.1 * held + 0.2 * carry, 0.4 * (poured > 0.0)) + 0.5 * poured


def tilted_over(progress: PourProgress, state: State) -> float:
    """Return the dense reward in [0, 1] for tilting a source in the hand over the target, see `dense_reward.tilting`.

    Args:
        progress: of the episode.
        state: the state.
    """
    source, target = state.object_pose
    distance = max(0.0, float(rim_gap(source, progress.sizes[SOURCE, 1], target)) - progress.sizes[TARGET, 0])
    tilt = min(1.0, float(tilt_of(source)) / TILTED)
    return float(tilting(distance, tilt, progress.verdict.held, progress.verdict.target / progress.count))
