"""A judge of motions by a robot's true meshes: fcl finds contacts, by no query of the planner's.

It samples: between two samples no joint moves more than a step. What the planner proves, it can only contradict.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ...planner import Obstacle
from .true_solids import TrueSolids, ball_of, solid_of

STEP = 0.01
"""Largest change [rad or m] of any joint between two samples."""


class Contact(NamedTuple):
    """A pair in contact.

    Attributes:
        sample: index of the sample.
        link: of the robot.
        other: obstacle, or another link.
    """

    sample: int
    link: str
    other: str


class MeshJudge:
    """Judge of one robot.

    Args:
        solids: true shapes of its links.
        own: pairs of solids that are checked against each other.
        own_every: samples from one check of these to the next: they move less than the arm through the world.
    """

    def __init__(self, solids: TrueSolids, own: Sequence[tuple[int, int]], *, own_every: int = 1):
        self._robot, self._own, self._own_every = solids, list(own), own_every
        self._first, self._second = np.array(self._own, dtype=int).reshape(-1, 2).T
        self._reach = solids.balls[self._first] + solids.balls[self._second]

    def first_contact(self, joints: np.ndarray, obstacles: Sequence[Obstacle]) -> Contact | None:
        """Return the first contact on straight lines in joint space; None if there is none.

        Args:
            joints: (t, dof) points of the motion.
            obstacles: in the world; they stand still.
        """
        import fcl

        robot = self._robot
        names, world = [obstacle.name for obstacle in obstacles], [solid_of(obstacle) for obstacle in obstacles]
        centers = np.array([obstacle.pose.position for obstacle in obstacles]).reshape(-1, 3)
        balls = np.array([ball_of(obstacle) for obstacle in obstacles])
        for k, q in enumerate(densely(joints, STEP)):
            mine = robot.move(q)
            gaps = np.linalg.norm(mine[:, None] - centers, axis=2) - robot.balls[:, None] - balls
            for one, other in np.argwhere(gaps <= 0.0):
                if one in robot.moving and fcl.collide(robot.solids[one], world[other]) > 0:
                    return Contact(k, robot.links[one], names[other])
            if k % self._own_every:
                continue
            apart = np.linalg.norm(mine[self._first] - mine[self._second], axis=1)
            for p in np.flatnonzero(apart <= self._reach):
                one, other = self._own[p]
                if robot.touch(one, other):
                    return Contact(k, robot.links[one], robot.links[other])
        return None


def densely(joints: np.ndarray, step: float) -> np.ndarray:
    """Return points on the lines of a motion between which no joint moves more than a step.

    Args:
        joints: (t, dof) points.
        step: largest change of a joint [rad or m].
    """
    rows = [joints[:1]]
    kept = joints[0]
    for row in joints[1:]:
        count = int(np.ceil(np.abs(row - kept).max() / step))
        if count:
            rows.append(kept + np.arange(1, count + 1)[:, None] / count * (row - kept))
            kept = row
    return np.vstack(rows)
