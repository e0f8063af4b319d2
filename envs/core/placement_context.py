"""Context of a placement: the motions to block, and what must stay reachable."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ...planner import Arm, Body, Obstacle, Pose, Shape
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.geometry.dualquat import sclerp
from ...planner.geometry.shapes import OBSTACLE, Packed, pack
from ..scene.body_clearance import arm_clearance, point_clearance, tool_clearance

START_CLEARANCE, POSTURE_CLEARANCE, SOLID_CLEARANCE, FLOOR_CLEARANCE = 0.05, 0.02, 0.02, 0.03
"""Least clearances [m] of an obstacle: from the arm at the start, from its postures at key poses, from objects and
furniture, and from the table."""
SEEDS = 24
"""Postures tried at each key pose."""
NEAR = 1.0
"""Largest change of a joint [rad] between successive keys of a straight motion that counts as the same posture."""
SWEEP = 21
"""Number of poses that sample the volume swept along a motion."""


@dataclass(frozen=True)
class PlacementMotion:
    """A motion of the hand that obstacles are to block.

    Attributes:
        start: tcp pose at the raised start.
        end: tcp pose at the raised end.
        keys: tcp poses that must stay reachable, each with its symmetric alternatives.
        shape: shape of the held object.
        tcp_from_object: pose of the held object in the tcp frame.
        motion: the task's motion index during this motion.
        aside: largest lateral offset [m] of an obstacle's center from the hand's straight path.
        above: largest vertical offset [m] from this path; larger for objects that sweep more.
        straight: number of last keys that form one straight motion, which an arm does without changing its posture.
    """

    start: Pose
    end: Pose
    keys: tuple[tuple[Pose, ...], ...]
    shape: Shape
    tcp_from_object: Pose
    motion: int
    aside: float = 0.02
    above: float = 0.03
    straight: int = 1

    @cached_property
    def sweep(self) -> np.ndarray:
        """(SWEEP, 8) tcp poses along the motion, as dual quaternions."""
        return sclerp(self.start.dq, self.end.dq, np.linspace(0.0, 1.0, SWEEP))


class ObstacleRequest(NamedTuple):
    """Specification of an obstacle to place.

    Attributes:
        kind: "static", "appear", "moving" or "forearm".
        motion: index of the motion to block.
        size: extent [m], or peak speed [m/s] of a moving obstacle; None: drawn at random.
    """

    kind: str
    motion: int
    size: float | None = None


class PlacementContext:
    """Scene into which obstacles are placed.

    Args:
        motions: all motions of the hand.
        arm: kinematics of the arm.
        body: capsules of the arm with an empty hand.
        joints: (dof,) joints at the start [rad].
        solids: everything solid in the scene.
        things: solids other than fixtures: objects and furniture.
        floor: z of the table top [m].
    """

    def __init__(
        self,
        motions: list[PlacementMotion],
        arm: Arm,
        body: Body,
        joints: np.ndarray,
        solids: list[Obstacle],
        things: list[Obstacle],
        floor: float,
    ):
        self.motions, self.arm, self.body, self.joints, self.floor = motions, arm, body, joints, floor
        self.tools = [body.holding("held", motion.shape, motion.tcp_from_object, arm).tool(arm) for motion in motions]
        self._solids, self._things = pack(solids), pack(things)
        self._keys = [key for motion in motions for key in _alternatives(motion)]
        self._key_poses = [np.array([pose.dq for key in motion.keys for pose in key]) for motion in motions]
        self._postures: dict[int, list[list[np.ndarray]]] = {}

    def has_room(self, places: Packed, clearance: float) -> bool:
        """Return whether an obstacle leaves clearance at the start, at the key poses, to the solids and to the table.

        Args:
            places: obstacle at each of its sampled positions.
            clearance: least clearance of the hand at the key poses [m].
        """
        for row in places.rows:
            center, ball = row[OBSTACLE.center : OBSTACLE.rotation], row[OBSTACLE.ball]
            if (
                center[2] - ball < self.floor + FLOOR_CLEARANCE
                or point_clearance(center, self._solids) - ball < SOLID_CLEARANCE
            ):
                return False
        if arm_clearance(self.arm, self.body, self.joints, places) < START_CLEARANCE:
            return False
        return all(
            tool_clearance(tool, poses, places) >= clearance
            for tool, poses in zip(self.tools, self._key_poses, strict=True)
        )

    def has_postures(self, places: Packed) -> bool:
        """Return whether each key pose, and the straight motion, has a posture clear of all these obstacles."""
        return all(
            any(
                all(arm_clearance(self.arm, self.body, q, places) >= POSTURE_CLEARANCE for q in postures)
                for postures in self._postures_at(index)
            )
            for index in range(len(self._keys))
        )

    def nominal(self, motion: PlacementMotion) -> list[np.ndarray]:
        """Return postures (dof,) along a motion, each near the one before; empty if the arm cannot follow it."""
        q, found = self.joints, []
        for row in motion.sweep[::2]:
            reached = inverse_kinematics(self.arm, Pose(row), q)
            if reached is None:
                return []
            q = reached
            found.append(q)
        return found

    def _postures_at(self, index: int) -> list[list[np.ndarray]]:
        """Return the postures found for a key, cached; the random seeds are the same for every start."""
        if index not in self._postures:
            rng = np.random.default_rng(index)
            seeds = [self.joints, *rng.uniform(self.arm.lower, self.arm.upper, (SEEDS - 1, self.arm.dof))]
            tried = [self._along(line, q) for q in seeds for line in self._keys[index]]
            self._postures[index] = [postures for postures in tried if postures]
        return self._postures[index]

    def _along(self, line: tuple[Pose, ...], seed: np.ndarray) -> list[np.ndarray]:
        """Return postures along a line, each near the one before and clear of things; empty if one is missing."""
        found: list[np.ndarray] = []
        for pose in line:
            q = inverse_kinematics(self.arm, pose, found[-1] if found else seed)
            if q is None or (found and np.abs(q - found[-1]).max() > NEAR):
                return []
            # the hand may be near the object it takes and the place where it puts the object
            if arm_clearance(self.arm, self.body, q, self._things, range(0, self.arm.dof - 1)) < 0.0:
                return []
            found.append(q)
        return found


def _alternatives(motion: PlacementMotion) -> Iterator[tuple[tuple[Pose, ...], ...]]:
    """Yield the lines to follow for each key, one per symmetric alternative; the straight keys form one line."""
    single = len(motion.keys) - motion.straight
    for key in motion.keys[:single]:
        yield tuple((pose,) for pose in key)
    yield tuple(zip(*motion.keys[single:], strict=True))
