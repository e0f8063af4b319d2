"""Thinking while the arm stands: the actions of standing still until a computation has its result."""

from __future__ import annotations

from collections.abc import Callable, Generator
from typing import TypeVar

import numpy as np

from ...planner.resumable import Paced, Resumable

T = TypeVar("T")
Thought = Generator[np.ndarray, None, T]
"""Actions of standing still until a result is there."""


def thought(work: Resumable[T], budget: float, still: Callable[[], np.ndarray]) -> Thought[T]:
    """Yield actions during a computation, done by a budget per tick; return its result.

    Args:
        work: the computation, see `planner.resumable`.
        budget: cost [us] of a tick's part of it.
        still: returns the action of standing still, guarded.
    """
    paced = Paced(work)
    while not paced.advance(budget):
        yield still()
    return paced.result
