"""Closed loops that a plan may try, the likeliest first."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

from ..escape.detour import ESCAPED, FREE
from ..escape.repet import Corner
from .settings import PlanSettings


class Attempt(NamedTuple):
    """A closed loop to try.

    Attributes:
        guide: fraction of the imitated path before the guiding pose.
        bias: of the detours, see `RepetSettings.bias`.
        factor: of the planning margin.
        early: detours rejoin the path at the first possible pose.
        detours: False: the path is followed without.
    """

    guide: float
    bias: Corner
    factor: float = 1.0
    early: bool = False
    detours: bool = True


def attempts(settings: PlanSettings, escapes: list[int]) -> Iterator[Attempt]:
    """Yield the closed loops to try, the likeliest first.

    Args:
        settings: of the planner.
        escapes: statuses of the tries so far, which grows: biases help where the arm could not follow a detour, not
            where there is none.
    """
    guide, later = settings.motion.guide, settings.motion.max_guide
    first = settings.biases[0]
    yield Attempt(guide, first)
    if escapes[-1] == ESCAPED:
        yield Attempt(guide, first, early=True)
    if escapes[-1] in (FREE, ESCAPED):
        yield Attempt(later, first)
    if not settings.avoid:
        return
    yield Attempt(guide, first, settings.tight)
    if escapes[-1] == ESCAPED:
        for bias in settings.biases[1:]:
            yield Attempt(guide, bias, settings.tight)
