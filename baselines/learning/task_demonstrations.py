"""Which part of the demonstration is one episode of a task of one object, and what its end is relative to."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ...planner.errors import UnknownName
from ...planner.imitation.demonstration import Demonstration
from .demonstration_episode import Goal, Playback, Transitions, as_shown, demo_episode, held_to_goal, tcp_to_goal


class SegmentPlayback(NamedTuple):
    """How the demonstration becomes an episode of a task.

    Attributes:
        segment: whose path is followed.
        goal: takes the demonstration; where the path is to end.
        playback: how it is followed, and what comes after it.
    """

    segment: str
    goal: Callable[[Demonstration], Goal]
    playback: Playback


BLOCK, BOOK, TARGET = -1, 0, 1
"""Of the objects: the block and the book that are in the hand, and the glass that is poured into."""
EPISODES = {
    "reach": SegmentPlayback("approach", lambda _: tcp_to_goal(), Playback(ending="none", withdraw=0.0)),
    # the block is held above its place: what comes before the middle of the path is the way from elsewhere
    "place_one": SegmentPlayback("transfer", lambda _: held_to_goal(BLOCK), Playback(begin=0.5)),
    "tilt_pour": SegmentPlayback(
        "carry", lambda demo: as_shown(demo, "carry", TARGET), Playback(hold=2.0, withdraw=0.0)
    ),
    "insert_one": SegmentPlayback("insert", lambda _: held_to_goal(BOOK), Playback(withdraw=0.2)),
}
"""By the task's name."""


def task_episode(env: Any, demonstration: Demonstration, *, seed: int = 0) -> Transitions:
    """The ONE demonstration as an episode of a task of one object, from its nominal start.

    Args:
        env: see `demo_episode`.
        demonstration: of the task, or of the one it is a part of.
        seed: of the start.

    Raises:
        UnknownName: no such task, or the demonstration has no such segment.
        BadOption: see `demo_episode`.
    """
    name = env.unwrapped.task.name
    if name not in EPISODES:
        raise UnknownName("task with an episode of the demonstration", name, EPISODES)
    shown = EPISODES[name]
    return demo_episode(
        env, demonstration, shown.segment, goal=shown.goal(demonstration), playback=shown.playback, seed=seed
    )
