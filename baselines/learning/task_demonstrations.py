"""Playback of the demonstration in single-object tasks: segment, goal and parameters for each task."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

from ...planner import Demonstration
from ...planner.errors import UnknownName
from .demonstration_episode import Goal, Playback, Transitions, as_shown, demo_episode, held_to_goal, tcp_to_goal


class SegmentPlayback(NamedTuple):
    """Conversion of the demonstration to an episode of a task.

    Attributes:
        segment: name of the segment to follow.
        goal: function of the demonstration that returns the goal of the path.
        playback: parameters of the playback.
    """

    segment: str
    goal: Callable[[Demonstration], Goal]
    playback: Playback


BLOCK, BOOK, TARGET = -1, 0, 1
"""Indices of the objects: block and book in the hand, and the glass that is poured into."""
EPISODES = {
    "reach": SegmentPlayback("approach", lambda _: tcp_to_goal(), Playback(ending="none", withdraw=0.0)),
    # the block starts above its place: the first half of the path comes from elsewhere
    "place_one": SegmentPlayback("transfer", lambda _: held_to_goal(BLOCK), Playback(begin=0.5)),
    "tilt_pour": SegmentPlayback(
        "carry", lambda demo: as_shown(demo, "carry", TARGET), Playback(hold=2.0, withdraw=0.0)
    ),
    "insert_one": SegmentPlayback("insert", lambda _: held_to_goal(BOOK), Playback(withdraw=0.2)),
}
"""Playback by task name."""


def task_episode(env: Any, demonstration: Demonstration, *, seed: int = 0) -> Transitions:
    """Play the ONE demonstration as an episode of a single-object task, from its nominal start.

    Args:
        env: see `demo_episode`.
        demonstration: demonstration of the task, or of the task it is a part of.
        seed: seed of the start.

    Raises:
        UnknownName: no such task, or the demonstration lacks the segment.
        BadOption: see `demo_episode`.
    """
    name = env.unwrapped.task.name
    if name not in EPISODES:
        raise UnknownName("task with an episode of the demonstration", name, EPISODES)
    shown = EPISODES[name]
    return demo_episode(
        env, demonstration, shown.segment, goal=shown.goal(demonstration), playback=shown.playback, seed=seed
    )
