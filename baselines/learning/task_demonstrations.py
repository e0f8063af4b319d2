"""Playback of the demonstration as an episode of a task: from the task's facts, or from the demonstration's skill."""

from __future__ import annotations

import math
from collections.abc import Iterator
from functools import partial
from typing import Any

from ...envs import TASKS, TaskDescription
from ...envs.facts.task_facts import SegmentPlayback, TaskFacts
from ...planner import Demonstration, Pose, imitated_path
from ...planner.errors import BadOption, UnknownName
from ...planner.imitation.tsia import departure
from ...planner.skills.skill import START, TASK_GOAL, Phase, Skill
from ..policy import Observation
from ..programs.skill_goals import Places
from ..programs.task_skills import skill_of
from .demonstration_episode import (
    GRIPS,
    Goal,
    Leg,
    LegAt,
    Playback,
    Transitions,
    as_shown,
    demo_episode,
    episode_of,
    held_to_goal,
    tcp_to_goal,
)

MOVED = ("carry", "slide")
"""Kinds of phases in which a thing is in the hand, and its path is followed."""


def task_episode(env: Any, demonstration: Demonstration, *, seed: int = 0) -> Transitions:
    """Play the ONE demonstration as an episode of a task with one object to move, from its nominal start.

    Args:
        env: see `demo_episode`.
        demonstration: demonstration of the task, or of the task it is a part of.
        seed: seed of the start.

    Raises:
        UnknownName: a shipped task with several motions, or the demonstration lacks the segment.
        BadDemonstration: it shows no skill, or none in this task.
        BadOption: see `demo_episode`; or the skill moves several things, or something on a hinge.
    """
    facts: TaskFacts = env.unwrapped.declared.facts
    if facts.playback is not None:
        played, playback = facts.playback, Playback(**facts.playback.options)
        return demo_episode(
            env, demonstration, played.segment, goal=_goal(played, demonstration), playback=playback, seed=seed
        )
    if facts.skill is not None:
        known = [name for name, each in TASKS.items() if each.playback is not None]
        raise UnknownName("task with an episode of the demonstration", facts.name, (*known, "a task of your own"))
    task: TaskDescription = env.unwrapped.task
    skill = task.skill or skill_of(demonstration, task)
    return episode_of(env, _legs(single_skill(skill), task), Playback(), seed=seed)


def single_skill(skill: Skill) -> Skill:
    """Return a skill if it moves one thing by hand, so that a demonstration of it can be played as an episode.

    Raises:
        BadOption: it moves several things, none, or one on a hinge.
    """
    moved = list(dict.fromkeys(phase.thing for phase in skill.phases if phase.kind in MOVED))
    on_hinge = [phase.thing for phase in skill.phases if phase.kind == "articulate"]
    if len(moved) != 1 or on_hinge:
        shown = " and ".join([*moved, *(f"{name} on its hinge" for name in on_hinge)]) or "nothing that is carried"
        raise BadOption("demonstration", f"shows {shown}; an episode for learners can be played of one carried object")
    return skill


def _goal(played: SegmentPlayback, demonstration: Demonstration) -> Goal:
    if played.end == "at the goal":
        return tcp_to_goal(played.thing)
    if played.end == "at its goal":
        return held_to_goal(played.thing)
    return as_shown(demonstration, played.segment, played.thing)


def _legs(skill: Skill, task: TaskDescription) -> Iterator[LegAt]:
    """Yield the phases up to the last with the object in the hand; what follows is withdrawing."""
    last = max(k for k, phase in enumerate(skill.phases) if phase.kind in MOVED)
    grip = GRIPS["close" if skill.in_hand else "open"]
    for phase in skill.phases[: last + 1]:
        ending = phase.opening if phase.gripper == "open" else GRIPS.get(phase.gripper)
        yield partial(_leg, phase, Places(task), grip, ending)
        grip = grip if ending is None else ending


def _leg(phase: Phase, places: Places, grip: float, ending: float | None, observation: Observation) -> Leg:
    """Return the hand's path of a phase, moved to where its end is now."""
    hand = Pose.from_vector(observation["tcp_pose"][0])
    if phase.kind in ("lift", "leave"):
        return Leg(departure(phase.path, hand, math.inf), grip, ending)
    path, body = phase.path, Pose.identity()
    if phase.kind in MOVED and not phase.by_hand:
        body = places.pose(phase.thing, observation).inverse() @ hand
        path = path.with_tool(body)
    if phase.reference == TASK_GOAL:
        at = Pose.from_vector(observation["goal_pose"][places.index(phase.thing)])
    elif phase.reference == START:
        at = hand @ body.inverse()
    else:
        at = places.pose(phase.reference, observation)
    return Leg(imitated_path(path, at @ phase.goals[0] @ body), grip, ending)
