"""Long computations in slices of a deterministic size, so that a control loop is never held up by one.

Such a computation is a generator: it yields the cost of each slice and returns its result. Costs are counted, not
measured: numbers of roll-out ticks, of nodes, of steps of a proof, each times what it takes on a machine where
Pinocchio's kinematics and Jacobian of a Panda take 0.7 us. A budget therefore cuts at the same places on any machine.
Not in the paper, whose planning takes no time.
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Generic, TypeVar

T = TypeVar("T")
Resumable = Generator[float, None, T]
"""A computation that yields the cost [us] of each slice and returns its result."""

TICK, NODE, PROOF, SOLVED, SCENE, CALL = 9.0, 2.5, 4.5, 70.0, 300.0, 30.0
"""Costs [us] of a tick of a roll-out, of a node of an escape tree, of a step of the proof of an edge in joint space, of
an inverse kinematics, of laying out a scene, and of what surrounds a call."""


def finished(work: Resumable[T]) -> T:
    """Return the result of a computation, done without a pause."""
    while True:
        try:
            next(work)
        except StopIteration as end:
            return end.value


class Paced(Generic[T]):
    """A computation that is advanced by a budget at a time.

    Args:
        work: the computation.

    Attributes:
        result: its result once it is `over`.
        over: True once it has ended.
    """

    result: T

    def __init__(self, work: Resumable[T]):
        self._work, self._owed, self.over = work, 0.0, False

    def advance(self, budget: float) -> bool:
        """Go on until a budget [us] is used up; the last slice may exceed it, at the cost of the next budget.

        Returns:
            True once the computation has ended.
        """
        left = budget - self._owed
        while not self.over and left > 0.0:
            try:
                left -= next(self._work)
            except StopIteration as end:
                self.result, self.over = end.value, True
        self._owed = max(0.0, -left)
        return self.over
