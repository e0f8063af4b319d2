"""What stands on the table, and the table."""

from __future__ import annotations

from dataclasses import dataclass

TABLE_HEIGHT = 0.8
"""z of the table top [m]."""
TABLE_HALF_SIZE = 0.4
"""Of the table top, in x and y [m]."""


@dataclass(frozen=True)
class Box:
    """A free wooden box: name, full extents (3,) [m] and a robosuite texture name."""

    name: str
    size: tuple[float, float, float]
    texture: str
    density: float = 600.0
