"""The rules of stacking: progress, success, wanted contacts, dense reward, from the simulator's state only."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from .scene import ARM, FINGERS, FIRST_OBJECT, WORLD

BLOCK_SIZE = (0.06, 0.04, 0.05)
BLOCK = 0.04
"""Blocks whose centers are nearer than this in the plane are inside each other [m]."""
MAX_OFFSET, MAX_YAW, MAX_HEIGHT = 0.010, np.deg2rad(10.0), 0.005
"""A block is in place within these [m, rad, m]."""
STILL = 0.01
"""A block slower than this stands [m/s]."""
WITHDRAWN = 0.05
"""Distance of the tcp to every block's center from which on the hand has withdrawn [m]."""
SETTLED_SECONDS = 0.5
LOST = 0.02
"""A block that was lifted and now stands farther than this from its place was dropped [m]."""
LIFTED = 0.02
"""Height above its start at which a block counts as lifted [m]."""


def yaw_error(pose: list[float], goal: list[float]) -> float:
    """Yaw between two poses (7,) [rad], half turns not counted, in [0, pi / 2]."""
    turn = 2.0 * (math.atan2(pose[6], pose[3]) - math.atan2(goal[6], goal[3])) % math.pi
    return min(turn, math.pi - turn)


class StackProgress:
    """What has happened in an episode so far, renewed from the simulator's state at each step."""

    def __init__(self, n_blocks: int, dt: float):
        self.n_blocks = n_blocks
        self._needed = round(SETTLED_SECONDS / dt)
        self._settled_steps = 0
        self._start_height: list[float] | None = None
        self.placed = 0
        self.held = False
        self._lifted = [False] * n_blocks
        self._best_stage = 0
        self.collisions = 0
        self.collision = ""
        self.failure = ""
        self.offset = [0.0] * n_blocks
        self.yaw = [0.0] * n_blocks

    @property
    def current(self) -> int:
        """The block that is to be moved, the last one when all are placed."""
        return min(self.placed, self.n_blocks - 1)

    @property
    def motion_index(self) -> float:
        """2k while block k is to be fetched, 2k + 1 while it is held."""
        return float(2 * self.placed + (1 if self.held else 0))

    @property
    def success(self) -> bool:
        """All blocks have been in place, at rest and let go for long enough."""
        return self._settled_steps >= self._needed

    def update(
        self,
        poses: list[list[float]],
        goals: list[list[float]],
        tcp: list[float],
        touching: set[tuple[int, int]],
        velocities: list[list[float]],
    ) -> None:
        """Take in a new state; plain numbers, since this runs at every step and the lists are short.

        Args:
            poses: (n, 7) blocks.
            goals: (n, 7) their goals.
            tcp: (3,) the tcp [m].
            touching: who touches whom, see `Simulation.contacts`.
            velocities: (n, 3) of the blocks [m/s].
        """
        if self._start_height is None:
            self._start_height = [pose[2] for pose in poses]
        placed, counting, all_still, all_clear, lost = 0, True, True, True, False
        for k, (pose, goal, velocity) in enumerate(zip(poses, goals, velocities, strict=True)):
            self.offset[k] = math.hypot(pose[0] - goal[0], pose[1] - goal[1])
            self.yaw[k] = yaw_error(pose, goal)
            in_hand = (FINGERS, FIRST_OBJECT + k) in touching
            there = self.offset[k] <= MAX_OFFSET and self.yaw[k] <= MAX_YAW
            in_place = there and abs(pose[2] - goal[2]) <= MAX_HEIGHT and not in_hand
            counting = counting and in_place
            placed += counting
            still = math.hypot(*velocity) < STILL
            all_still = all_still and still
            all_clear = all_clear and math.dist(pose[:3], tcp) >= WITHDRAWN
            raised = pose[2] > self._start_height[k] + LIFTED
            self._lifted[k] |= raised and in_hand
            lost |= self._lifted[k] and still and not in_hand and not in_place and self.offset[k] > LOST
        self.placed = placed
        self.held = placed < self.n_blocks and (FINGERS, FIRST_OBJECT + placed) in touching
        settled = placed == self.n_blocks and all_still and all_clear
        self._settled_steps = self._settled_steps + 1 if settled else 0
        raised = self.held and poses[placed][2] > self._start_height[placed] + LIFTED
        self._best_stage = max(self._best_stage, 2 * placed + int(raised))
        self.failure = "dropped" if lost else ""

    def info(self) -> dict[str, Any]:
        """The entries of `info`."""
        return {
            "is_success": self.success,
            "success": self.success,
            "safe": self.collisions == 0,
            "stage": stage_name(self._best_stage, self.n_blocks),
            "failure_reason": self.failure,
            "collision": self.collision,
            "n_contacts": self.collisions,
            "min_obstacle_distance": float("inf"),
            "blocks_placed": self.placed,
            "position_error": np.array(self.offset),
            "yaw_error": np.array(self.yaw),
        }


def stage_name(best: int, n_blocks: int) -> str:
    """The furthest progress in words."""
    if best == 0:
        return "start"
    if best % 2:
        return f"lifted block {best // 2 + 1} of {n_blocks}"
    return f"placed {best // 2} of {n_blocks}"


def allowed_contact(pair: tuple[int, int], progress: StackProgress) -> bool:
    """Whether two owners may touch: see WORLD in `sim` for their numbers, the smaller first.

    Wanted are blocks on the table, a block on the next lower one of the stack, and the fingers on the block that
    is being fetched, held or was let go last.
    """
    low, high = pair
    if high < FIRST_OBJECT or low == ARM:
        return False
    block = high - FIRST_OBJECT
    if low == WORLD:
        return True
    if low == FINGERS:
        return block in (progress.placed, progress.placed - 1)
    return block - (low - FIRST_OBJECT) == 1


def shaped(poses: list[list[float]], goals: list[list[float]], tcp: list[float], progress: StackProgress) -> float:
    """Dense reward in [0, 1]: the share of blocks placed, and of the current one reached, grasped and carried."""
    if progress.placed == progress.n_blocks:
        return 1.0
    k = progress.current
    reach = 1.0 - math.tanh(5.0 * math.dist(poses[k][:3], tcp))
    carry = 1.0 - math.tanh(5.0 * math.dist(poses[k][:3], goals[k][:3]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if progress.held else 0.0)
    return (progress.placed + part) / progress.n_blocks
