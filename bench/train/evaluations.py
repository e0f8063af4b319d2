"""The evaluations of a training as its folder keeps them; needs no torch."""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ...planner.errors import BadConfig

NUMBERS, LEG = "state.json", "leg-{:05d}"


@dataclass(frozen=True, slots=True)
class Point:
    """An evaluation.

    Attributes:
        seed: of the training.
        leg: how many evaluations there were, this one included.
        steps: of the environment until then; gradient steps of "bc".
        successes: (n,) of each scenario, in order.
        returns: (n,) sum of dense rewards of each scenario; a success counts as 1 for every step that it saved.
        seconds: real time of all legs so far, evaluations included; not part of the result.
    """

    seed: int
    leg: int
    steps: int
    successes: tuple[bool, ...]
    returns: tuple[float, ...]
    seconds: float

    @property
    def success(self) -> float:
        """Share of the scenarios."""
        return float(np.mean(self.successes))


def last_leg(folder: Path) -> Path | None:
    """The folder of the last whole leg of a seed; None: there is none."""
    return max(folder.glob("leg-*"), default=None)


def numbers_of(leg: Path) -> dict[str, Any]:
    """What the state of a leg says besides weights.

    Raises:
        BadConfig: it cannot be read.
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
    """The evaluations so far."""
    return [
        Point(**{**each, "successes": tuple(each["successes"]), "returns": tuple(each["returns"])})
        for each in numbers["points"]
    ]
