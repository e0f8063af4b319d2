"""Evaluations of a training as its folder stores them; needs no torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig

NUMBERS, LEG = "state.json", "leg-{:05d}"
"""File with the curve and counters of a seed, and folder of the training round after which it was written."""


@dataclass(frozen=True, slots=True)
class Point:
    """Evaluation at the end of a training round (`leg`).

    Attributes:
        seed: seed of the training.
        leg: number of evaluations so far, this one included.
        steps: environment steps so far; for "bc", gradient steps.
        successes: (n,) success in each scenario, in order.
        returns: (n,) sum of dense rewards in each scenario; a success adds 1 for every step it saved.
        seconds: real time [s] of all rounds so far, evaluations included; not part of the result.
    """

    seed: int
    leg: int
    steps: int
    successes: tuple[bool, ...]
    returns: tuple[float, ...]
    seconds: float

    @property
    def success(self) -> float:
        """Share of successes."""
        return float(np.mean(self.successes))


def last_leg(folder: Path) -> Path | None:
    """Return the folder of a seed's last complete training round, or None."""
    return max(folder.glob("leg-*"), default=None)


def numbers_of(leg: Path) -> dict[str, Any]:
    """Return the JSON part of a round's state: curve, counters, config digest.

    Raises:
        BadConfig: the file cannot be read.
    """
    file = leg / NUMBERS
    try:
        numbers = json.loads(file.read_text(encoding="utf-8"))
        points_of(numbers)
        str(numbers["digest"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        reason = f"cannot be read ({type(error).__name__}); remove {leg} to begin this seed anew"
        raise BadConfig(file, "", reason) from None
    return numbers


def points_of(numbers: dict[str, Any]) -> list[Point]:
    """Return the evaluations stored in a state."""
    return [
        Point(**{**each, "successes": tuple(each["successes"]), "returns": tuple(each["returns"])})
        for each in numbers["points"]
    ]
