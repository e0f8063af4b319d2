"""Difficulty levels: spread of the starts and kind of obstacles, with the same names for every task."""

from __future__ import annotations

from dataclasses import dataclass

from ...planner.errors import BadOption, UnknownName
from ..simulation.moving_obstacles import ScheduledObstacle

OBSTACLES = ("none", "static", "appear", "moving", "unforeseen", "forearm", "paper")
"""Kinds of obstacles: static ones on the hand's path; one that appears during a motion; one that swings across the
path; one of the last two, drawn at random ("unforeseen"); a static one where the forearm passes; and the paper's."""


@dataclass(frozen=True, slots=True)
class Level:
    """Starts and obstacles of a level.

    Attributes:
        layout: name of the ranges from which starts and goals are drawn, "L0", "L1" or "L2".
        words: what it is.
        obstacles: kind of obstacles, see `OBSTACLES`.
    """

    layout: str
    words: str
    obstacles: str = "none"


LEVELS = {
    "L0": Level("L0", "the demonstration's own layout"),
    "L1": Level("L1", "starts and goals moved"),
    "L2": Level("L2", "moved farther"),
    "L3": Level("L2", "L2 with still obstacles", "static"),
    "L4": Level("L2", "L2 with an obstacle that moves or appears", "unforeseen"),
    "F": Level("L2", "L2 with an obstacle at the forearm", "forearm"),
    "R": Level("L1", "L1 on another robot"),
    "S": Level("L1", "L1 with a few key poses of the demonstration"),
    "T": Level("L1", "L1 with another tool frame"),
}
"""Levels by name. R is L1 on another robot, S L1 with a few key poses of the demonstration, T L1 with the hand
commanded in another frame: starts and goals are those of L1, the run does the rest (keys `robot`, `key_poses` and
`tool` of its cells)."""


def level_named(name: object) -> Level:
    """Return the level with a given name.

    Raises:
        UnknownName: no such level.
    """
    if not isinstance(name, str) or name not in LEVELS:
        raise UnknownName("level", name, [f"{known} ({level.words})" for known, level in LEVELS.items()])
    return LEVELS[name]


def checked_obstacles(value: object, slots: int) -> str | tuple[ScheduledObstacle, ...]:
    """Return a kind of obstacles, or given obstacles as a tuple, after checking them.

    Args:
        value: kind from `OBSTACLES`, or a list or tuple of obstacles.
        slots: largest number of obstacles.

    Raises:
        UnknownName: no such kind.
        BadOption: neither a kind nor at most `slots` obstacles.
    """
    if isinstance(value, str):
        if value not in OBSTACLES:
            raise UnknownName("obstacles", value, OBSTACLES)
        return value
    if not isinstance(value, tuple | list) or not all(isinstance(each, ScheduledObstacle) for each in value):
        raise BadOption(
            "obstacles", f"{value!r} is neither one of {', '.join(OBSTACLES)} nor a list of ScheduledObstacle"
        )
    if len(value) > slots:
        raise BadOption("obstacles", f"there are {len(value)}; at most {slots} are possible")
    return tuple(value)
