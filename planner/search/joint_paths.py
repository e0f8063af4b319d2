"""Clear paths in joint space, searched and shortened in slices."""

from __future__ import annotations

import numpy as np

from ..collision.robot_arrays import HEADER, ROW
from ..resumable import CALL, PROOF, Resumable
from .joint_space_rrt import connect, shortcut

SAMPLES, LINES = 2, 1
"""Samples of a search, and shortcuts that are tried, between two pauses: a single edge may take 1000 steps to prove."""


class JointPaths:
    """Search of clear paths in joint space, in slices.

    Args:
        dof: number of joints.
        nodes: largest number of nodes of a tree.
        seed: of the random numbers.
    """

    def __init__(self, dof: int, nodes: int, seed: int):
        self._trees, self._parents = np.empty((2, nodes, dof)), np.empty((2, nodes))
        self._out, self._ends = np.empty((2 * nodes, dof)), np.empty((2, dof))
        self._state, self._counts = np.array([float(seed % 2147483646) + 1.0]), np.zeros(2, dtype=np.int64)

    def connected(
        self, g: np.ndarray, start: np.ndarray, goal: np.ndarray, step: float, samples: int, shortcuts: int
    ) -> Resumable[np.ndarray | None]:
        """Search a path, and shorten it.

        Args:
            g: the robot among obstacles, see `robot_arrays`.
            start: (n,) joints [rad or m].
            goal: (n,) joints.
            step: length of the longest edge [rad or m].
            samples: largest number of samples.
            shortcuts: number of shortcuts that are tried.

        Returns:
            Points (k, n) of the path; None if none was found.
        """
        count = 0
        for first in range(0, samples, SAMPLES):
            before, last = g[ROW.header, HEADER.proofs], min(samples, first + SAMPLES)
            count = connect(
                g, start, goal, self._trees, self._parents, step, first, last, self._counts, self._state, self._out
            )
            yield CALL + PROOF * (g[ROW.header, HEADER.proofs] - before)
            if count:
                break
        if count <= 0:
            return None
        for tried in range(0, shortcuts, LINES):
            before = g[ROW.header, HEADER.proofs]
            count = shortcut(g, self._out, count, min(LINES, shortcuts - tried), self._state, self._ends)
            yield CALL + PROOF * (g[ROW.header, HEADER.proofs] - before)
        return self._out[:count].copy()
