"""The rules of stacking: progress, success, wanted contacts, dense reward, from the simulator's state only.

The numbers are judged in compiled code, see `state`; `StackProgress` keeps what they came to.
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
"""Blocks whose centers are nearer than this in the plane are inside each other [m]."""
MAX_OFFSET, MAX_YAW, MAX_HEIGHT = 0.010, np.deg2rad(10.0), 0.005
"""A block is in place within these [m, rad, m]."""
STILL = 0.01
"""A block slower than this stands [m/s]."""
WITHDRAWN = 0.05
"""Distance of the tcp to every block's center from which on the hand has withdrawn [m]."""
LOST = 0.02
"""A block that was lifted and now stands farther than this from its place was dropped [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""A block whose center is below this has fallen off the table [m]."""
LIFTED = 0.02
"""Height above its start at which a block counts as lifted [m]."""


FIRST, WAS_LIFTED = 0, 1
"""Rows of the memory: height of each block at the start, and 1 once it was lifted."""


class StackVerdict(NamedTuple):
    """What the compiled judge says of a state; counts and flags as whole numbers.

    Attributes:
        placed: blocks in place, from the lowest on.
        held: the next block is in the hand.
        raised: and is lifted.
        settled: all blocks are in place and at rest, and the hand has withdrawn.
        lost: a block that was lifted stands elsewhere.
        fallen: a block is off the table.
        unwanted: pairs that touch and should not.
        low: the smaller owner of the last of them, or -1.
        high: the other owner.
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
    """Yaw between two poses (7,) [rad], half turns not counted, in [0, pi / 2]."""
    turn = 2.0 * (math.atan2(pose[6], pose[3]) - math.atan2(goal[6], goal[3])) % math.pi
    return min(turn, math.pi - turn)


@kernel
def allowed_contact(low, high, placed):
    """Whether two owners may touch: see WORLD in `scene` for their numbers, the smaller first.

    Wanted are blocks on the table, a block on the next lower one of the stack, and the fingers on the block that
    is being fetched, held or was let go last. A robot's contact with itself says nothing.
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
    """Of two points (3,) [m]."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def judge_state(poses, velocities, tcp, touching, goals, memory, errors):
    """Judge a state: the entries of a `StackVerdict`.

    Args:
        poses: (n, 7) blocks.
        velocities: (n, 3) of the blocks [m/s].
        tcp: (n_arms, 7) the tools.
        touching: (owners, owners) who touches whom, see `State`.
        goals: (n, 7) where the blocks must end.
        memory: (2, n) see FIRST; renewed.
        errors: (2, n) result: distance in the plane [m] and yaw [rad] of each block to its place.
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
        if in_hand and pose[2] > memory[FIRST, k] + LIFTED:
            memory[WAS_LIFTED, k] = 1.0
        lost |= memory[WAS_LIFTED, k] != 0.0 and still and not in_hand and not in_place and offset > LOST
        fallen |= pose[2] < LOWEST
    held = placed < n and touching[FINGERS, FIRST_OBJECT + placed] != 0.0
    raised = held and poses[placed, 2] > memory[FIRST, placed] + LIFTED
    unwanted, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            if touching[a, b] != 0.0 and not allowed_contact(a, b, placed):
                unwanted, low, high = unwanted + 1, a, b
    return placed, int(held), int(raised), int(placed == n and quiet), int(lost), int(fallen), unwanted, low, high


@kernel
def shaped(poses, goals, tcp, placed, held):
    """Dense reward in [0, 1]: the share of blocks placed, and of the current one reached, grasped and carried."""
    n = len(poses)
    if placed == n:
        return 1.0
    reach = 1.0 - math.tanh(5.0 * _distance(poses[placed], tcp[0]))
    carry = 1.0 - math.tanh(5.0 * _distance(poses[placed], goals[placed]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if held else 0.0)
    return (placed + part) / n


class StackProgress(Progress):
    """What has happened in an episode so far, renewed from the simulator's state at each step.

    Args:
        goals: (n, 7) where the blocks must end.
        start: (n, 7) where they are, or stood, at the start.
        dt: seconds between states.
        in_hand: the last one is in the hand from the start.
    """

    def __init__(self, goals: np.ndarray, start: np.ndarray, dt: float, *, in_hand: bool = False):
        super().__init__(dt)
        self.n_blocks = len(goals)
        self._goals = goals
        self._memory = np.stack([start[:, 2], np.zeros(self.n_blocks)])
        self._memory[WAS_LIFTED, -1] = float(in_hand)
        self._errors = np.zeros((2, self.n_blocks))
        self._best_stage = 0
        self._stages = [stage_name(best, self.n_blocks) for best in range(2 * self.n_blocks + 1)]
        self.placed = 0
        self.held = False
        self._failure = ""

    @property
    def motion_index(self) -> float:
        """2k while block k is to be fetched, 2k + 1 while it is held."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """A block is off the table."""
        return self._failure == "off_table"

    @property
    def stage(self) -> str:
        """The furthest progress in words."""
        return self._stages[self._best_stage]

    @property
    def failure(self) -> str:
        """Why it cannot succeed as things are, "" if it can."""
        return self._failure

    def update(self, state: State) -> StackVerdict:
        """Take in a new state."""
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
        """The dense reward of the state taken in last."""
        return shaped(state.object_pose, self._goals, state.tcp_pose, self.placed, self.held)

    def task_info(self) -> dict[str, Any]:
        """The task's own entries of `info`."""
        return {"blocks_placed": self.placed, "position_error": self._errors[0], "yaw_error": self._errors[1]}


def stage_name(best: int, n_blocks: int) -> str:
    """The furthest progress in words."""
    if best == 0:
        return "start"
    if best % 2:
        return f"lifted block {best // 2 + 1} of {n_blocks}"
    return f"placed {best // 2} of {n_blocks}"
