"""Report of a reader of robot models: which joints it held, what it did not use, and what looks wrong."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

from ..errors import ModelWarning

SHOWN = 8
"""Number of names that a warning lists; the report lists all."""

ONLY_SEEN = "links with a <visual> and no <collision>"
NOT_SOLID = "bodies whose geoms do not collide"
UNSEEN = (ONLY_SEEN, NOT_SOLID)
"""Beginnings of the lines about geometry that only `visuals` covers."""


@dataclass(frozen=True, slots=True)
class ModelReport:
    """Findings of a reader of robot models.

    Attributes:
        source: name of the model.
        held: positions of the joints that are held [rad or m]; 0 for a free, planar or ball joint, which stays where
            the model has it.
        unused: what the model contains and the reader does not use, a line each.
        warnings: what may make arm or body wrong, a line each.
    """

    source: str = ""
    held: Mapping[str, float] = field(default_factory=dict)
    unused: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def warn(self, stacklevel: int = 2) -> None:
        """Issue a `ModelWarning` for each warning.

        Args:
            stacklevel: of `warnings.warn`, counted from the caller.
        """
        for line in self.warnings:
            warnings.warn(f"{self.source}: {line}", ModelWarning, stacklevel=stacklevel + 1)


def listed(names: Iterable[str], most: int | None = None) -> str:
    """Return names in one line.

    Args:
        names: the names.
        most: number of names to list; the others are counted. None: all.
    """
    every = list(names)
    shown = every[:most]
    more = f" and {len(every) - len(shown)} more" if len(every) > len(shown) else ""
    return ", ".join(shown) + more
