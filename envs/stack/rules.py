"""Rules of stacking: progress, success, wanted contacts, dense reward, from the simulator's state only.

Compiled code judges the numbers, see `state`; `StackProgress` keeps the results.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...planner.jit import kernel
from ..core.progress import Progress
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OTHER_ARM, OTHER_FINGERS, WORLD
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State

BLOCK_SIZE = (0.06, 0.04, 0.05)
BLOCK = 0.04
"""Width of a block between the fingers; blocks whose centers are horizontally nearer than this overlap [m]."""
MAX_OFFSET, MAX_YAW, MAX_HEIGHT = 0.010, np.deg2rad(10.0), 0.005
"""Tolerances of a block at its goal: horizontal distance [m], yaw [rad], height [m]."""
STILL = 0.01
"""Speed below which a block counts as at rest [m/s]."""
WITHDRAWN = 0.05
"""Distance of the tcp to every block's center from which the hand counts as withdrawn [m]."""
LOST = 0.02
"""Horizontal distance from its goal beyond which a block that was lifted and is at rest was dropped [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""Height (z) of a block's center below which the block has fallen off the table [m]."""
LIFTED = 0.02
"""Height above its start from which a block counts as lifted [m]."""


class MemoryRows(NamedTuple):
    """Rows of the numbers that the judge of stacking remembers, one column per block."""

    height: int = 0  # initial height of the block [m]
    was_lifted: int = 1  # 1 once the block was lifted


MEMORY = MemoryRows()


class StackVerdict(NamedTuple):
    """Verdict of the compiled judge on a state; counts and flags are whole numbers.

    Attributes:
        placed: number of blocks in place, counted from the lowest.
        held: whether the next block is in the hand.
        raised: whether the held block is lifted.
        settled: whether all blocks are in place and at rest, and the hand has withdrawn.
        lost: whether a block was lifted and now rests elsewhere.
        fallen: whether a block is off the table.
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
    """

    placed: int
    held: int
    raised: int
    settled: int
    lost: int
    fallen: int
    unwanted: int
    low: int
    high: int


@kernel
def yaw_error(pose, goal):
    """Return the yaw between two poses [rad], half turns ignored, in [0, pi / 2].

    Args:
        pose: (7,) pose of a block, x y z [m] and wxyz.
        goal: (7,) its goal.
    """
    turn = 2.0 * (math.atan2(pose[6], pose[3]) - math.atan2(goal[6], goal[3])) % math.pi
    return min(turn, math.pi - turn)


@kernel
def allowed_contact(low, high, placed):
    """Return whether two owners may touch.

    Wanted contacts are blocks on the table, a block on the next lower one of the stack, and the fingers on the block
    that is being fetched, is held or was released last. A robot's contacts with itself are ignored.

    Args:
        low: smaller owner, see `WORLD` in `scene`.
        high: larger owner.
        placed: number of blocks in place.
    """
    if low == high or (low == ARM and high == FINGERS) or (low == OTHER_ARM and high == OTHER_FINGERS):
        return True
    if high < FIRST_OBJECT or low == ARM:
        return False
    block = high - FIRST_OBJECT
    if low == WORLD:
        return True
    if low == FINGERS:
        return block == placed or block == placed - 1
    return low >= FIRST_OBJECT and block - (low - FIRST_OBJECT) == 1


@kernel
def _distance(a, b):
    """Return the distance of two points (3,) [m]."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def judge_state(poses, velocities, tcp, touching, goals, memory, errors):
    """Judge a state; return the entries of a `StackVerdict`.

    Args:
        poses: (n, 7) poses of the blocks, x y z [m] and wxyz.
        velocities: (n, 3) velocities of the blocks [m/s].
        tcp: (n_arms, 7) tcp poses.
        touching: (owners, owners) contacts, see `State`.
        goals: (n, 7) goals of the blocks.
        memory: (2, n) see `MEMORY`; updated.
        errors: (2, n) result: horizontal distance [m] and yaw [rad] of each block to its goal.
    """
    n, placed, counting, quiet, lost, fallen = len(poses), 0, True, True, False, False
    for k in range(n):
        pose, goal = poses[k], goals[k]
        offset, yaw = math.hypot(pose[0] - goal[0], pose[1] - goal[1]), yaw_error(pose, goal)
        errors[0, k], errors[1, k] = offset, yaw
        in_hand = touching[FINGERS, FIRST_OBJECT + k] != 0.0
        there = offset <= MAX_OFFSET and yaw <= MAX_YAW and abs(pose[2] - goal[2]) <= MAX_HEIGHT
        in_place = there and not in_hand
        counting = counting and in_place
        placed += counting
        still = math.sqrt(velocities[k, 0] ** 2 + velocities[k, 1] ** 2 + velocities[k, 2] ** 2) < STILL
        quiet = quiet and still and _distance(pose, tcp[0]) >= WITHDRAWN
        if in_hand and pose[2] > memory[MEMORY.height, k] + LIFTED:
            memory[MEMORY.was_lifted, k] = 1.0
        lost |= memory[MEMORY.was_lifted, k] != 0.0 and still and not in_hand and not in_place and offset > LOST
        fallen |= pose[2] < LOWEST
    held = placed < n and touching[FINGERS, FIRST_OBJECT + placed] != 0.0
    raised = held and poses[placed, 2] > memory[MEMORY.height, placed] + LIFTED
    unwanted, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            if touching[a, b] != 0.0 and not allowed_contact(a, b, placed):
                unwanted, low, high = unwanted + 1, a, b
    return placed, int(held), int(raised), int(placed == n and quiet), int(lost), int(fallen), unwanted, low, high


@kernel
def shaped(poses, goals, tcp, placed, held):
    """Return the dense reward in [0, 1]: share of blocks placed, and of the current one reached, grasped and carried.

    Args:
        poses: (n, 7) poses of the blocks, x y z [m] and wxyz.
        goals: (n, 7) goals of the blocks.
        tcp: (n_arms, 7) tcp poses.
        placed: number of blocks in place.
        held: whether the next block is in the hand.
    """
    n = len(poses)
    if placed == n:
        return 1.0
    reach = 1.0 - math.tanh(5.0 * _distance(poses[placed], tcp[0]))
    carry = 1.0 - math.tanh(5.0 * _distance(poses[placed], goals[placed]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if held else 0.0)
    return (placed + part) / n


class StackProgress(Progress):
    """Progress of stacking, updated from the simulator's state at each step.

    Args:
        goals: (n, 7) goals of the blocks, x y z [m] and wxyz.
        start: (n, 7) poses at the start; of a block in the hand its pose on the table.
        dt: time between states [s].
        in_hand: whether the last block is in the hand from the start.
    """

    def __init__(self, goals: np.ndarray, start: np.ndarray, dt: float, *, in_hand: bool = False):
        super().__init__(dt)
        self.n_blocks = len(goals)
        self._goals = goals
        self._memory = np.stack([start[:, 2], np.zeros(self.n_blocks)])
        self._memory[MEMORY.was_lifted, -1] = float(in_hand)
        self._errors = np.zeros((2, self.n_blocks))
        self._best_stage = 0
        self._stages = [stage_name(best, self.n_blocks) for best in range(2 * self.n_blocks + 1)]
        self.placed = 0
        self.held = False
        self._failure = ""

    @property
    def motion_index(self) -> float:
        """Index of the current motion: 2k while fetching block k, 2k + 1 while holding it."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """True once a block is off the table."""
        return self._failure == "off_table"

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return self._stages[self._best_stage]

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed at present, "" if it can."""
        return self._failure

    def update(self, state: State) -> StackVerdict:
        """See `Progress`."""
        self._errors = np.empty((2, self.n_blocks))
        poses, moving, tcp = state.object_pose, state.object_velocity, state.tcp_pose
        verdict = StackVerdict(
            *judge_state(poses, moving, tcp, state.touching, self._goals, self._memory, self._errors)
        )
        self.placed, self.held = verdict.placed, verdict.held == 1
        self._settle(verdict.settled == 1, verdict)
        self._best_stage = max(self._best_stage, 2 * verdict.placed + verdict.raised)
        self._failure = "off_table" if verdict.fallen else "dropped" if verdict.lost else ""
        return verdict

    def reward(self, state: State) -> float:
        """See `Progress`."""
        return shaped(state.object_pose, self._goals, state.tcp_pose, self.placed, self.held)

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        return {"blocks_placed": self.placed, "position_error": self._errors[0], "yaw_error": self._errors[1]}


def stage_name(best: int, n_blocks: int) -> str:
    """Return the furthest progress in words.

    Args:
        best: 2 for each block placed, plus 1 if the next one was lifted.
        n_blocks: number of blocks.
    """
    if best == 0:
        return "start"
    if best % 2:
        return f"lifted block {best // 2 + 1} of {n_blocks}"
    return f"placed {best // 2} of {n_blocks}"
