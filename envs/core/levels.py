"""Levels of difficulty: how far a start may differ, and what is in the way. The same names for every task."""

from __future__ import annotations

from dataclasses import dataclass

from ...planner.errors import BadOption, UnknownName
from ..simulation.moving_obstacles import ScheduledObstacle

OBSTACLES = ("none", "static", "appear", "moving", "unforeseen", "forearm", "paper")
"""Kinds: still ones on the way of the hand; one that appears in the middle of a motion; one that swings across the
way; one of the last two, drawn; a still one where the forearm passes; and what the paper's experiment has."""


@dataclass(frozen=True, slots=True)
class Level:
    """What a level's name stands for.

    Attributes:
        layout: name of the ranges that starts and goals are drawn from, "L0", "L1" or "L2".
        obstacles: their kind.
    """

    layout: str
    obstacles: str = "none"


LEVELS = {
    "L0": Level("L0"),
    "L1": Level("L1"),
    "L2": Level("L2"),
    "L3": Level("L2", "static"),
    "L4": Level("L2", "unforeseen"),
    "F": Level("L2", "forearm"),
    "R": Level("L1"),
    "S": Level("L1"),
    "T": Level("L1"),
}
"""R is L1 on another robot, S with a few key poses of the demonstration, T with the hand moved in another frame: starts
and goals are those of L1, the rest is the run's to do (the keys `robot`, `key_poses` and `tool` of its cells)."""


def level_named(name: object) -> Level:
    """The level of a name.

    Raises:
        UnknownName: no such level.
    """
    if not isinstance(name, str) or name not in LEVELS:
        raise UnknownName("level", name, LEVELS)
    return LEVELS[name]


def checked_obstacles(value: object, slots: int) -> str | tuple[ScheduledObstacle, ...]:
    """A kind of obstacles, or obstacles themselves.

    Raises:
        UnknownName: no such kind.
        BadOption: neither a kind nor at most `slots` obstacles.
    """
    if isinstance(value, str):
        if value not in OBSTACLES:
            raise UnknownName("obstacles", value, OBSTACLES)
        return value
    if not isinstance(value, tuple | list) or not all(isinstance(each, ScheduledObstacle) for each in value):
        raise BadOption("obstacles", f"{value!r} is neither one of {', '.join(OBSTACLES)} nor a list of Intruder")
    if len(value) > slots:
        raise BadOption("obstacles", f"there are {len(value)}; at most {slots} are possible")
    return tuple(value)
