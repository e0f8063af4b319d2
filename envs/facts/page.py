"""The page of an environment, made of its spaces, its arguments and what is the task's own."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from inspect import Parameter, signature
from textwrap import fill
from typing import Any

from .task_facts import TaskFacts, named

WIDTH = 120
"""Characters in a line."""
ENTRIES = {
    "joint_positions": "[rad]",
    "joint_velocities": "[rad/s]",
    "tcp_pose": "point between the finger pads; fingers close along its x, the hand points along its z",
    "gripper_opening": "gap between the finger pads [m]",
    "object_pose": "poses of the objects",
    "goal_pose": "goals",
    "motion_index": "2k while k objects are in place, 2k + 1 while the fingers touch an object",
    "obstacle_active": "1 for a present obstacle; all entries of absent ones are 0",
    "obstacle_shape": "1 sphere, 2 box, 3 capsule",
    "obstacle_size": "box: extents; capsule: radius, radius, length of its segment; sphere: radius",
    "obstacle_pose": "poses of the obstacles",
    "obstacle_velocity": "velocities of their centers [m/s]",
    "furniture_pose": "poses of the fixtures",
    "bead_fraction": "share of the beads in each place",
    "scene_joint_positions": "positions of the scene's joints [rad or m]",
    "last_action": "last action; zeros at the start",
}
MODES = {
    "joint_velocity": (("0 to {last}", "joint speed as a fraction of the joint's limit"),),
    "ee_twist": (
        ("0 to 2", "velocity of the tcp in world axes as a fraction of 0.25 m/s"),
        ("3 to 5", "angular velocity of the tcp in world axes as a fraction of 1.2 rad/s"),
    ),
}
GRIPPER = "gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged"
ARGUMENTS = {
    "robot": "name of the robot, see `onedemo.envs.ROBOTS`",
    "level": "starts and obstacles, see below",
    "obstacles": 'None: those of the level; or "none", "static", "appear", "moving", "unforeseen" or "forearm"',
    "control_mode": '"joint_velocity" or "ee_twist"',
    "reward": '"sparse" or "dense"',
    "control_frequency": "actions per second: 10, 20, 25, 50 or any that divides 500; give `max_episode_steps`, too",
    "goal_form": "whether observations are those of Gymnasium's goal environments",
    "end_on_success": "whether a settled success ends the episode; None: with sparse rewards, not in the goal form",
    "render_mode": 'None, "rgb_array" or "human"',
    "arm": 'None: the robot\'s default arm; of Baxter "right" or "left", the other one is parked',
}
OPTIONS = {
    "level": "instead of the argument",
    "obstacles": "a kind, or a list of `ScheduledObstacle`",
    "joint_positions": "of the arm, (7,)",
}
NUMBERS = """\
`is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`, `n_contacts`
(steps with an obstacle touched), `min_obstacle_distance` [m] (smallest so far, of the whole arm and the held object),
`layouts_refused` (starts that had no space for the obstacles)"""
LEVELS = """\
L3, L4 and F are L2 with obstacles that block {blocked}: L3 has one to three static ones of 3 to 10 cm, L4 one that
swings across it at up to 0.3 m/s or appears during the motion, F a static one where the forearm passes. R, S and T
start as L1 does. Obstacles are solid. They overlap the volume that the hand, and what it holds, sweeps on the
straight path, and leave clearance at the start, at the key poses of the task and at the goals, for any method."""
TOO_SHORT = "R, S and T start as L1 does. The motion is too short for obstacles: L3, L4 and F do not exist."
GOAL_FORM = """\
With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
vector), `achieved_goal` and `desired_goal` {goals}. `compute_reward(achieved, desired, info)` accepts one goal or
many. Stable-Baselines3's HER works with it."""
OBSERVED = """\
A `Dict` of float64 boxes, with these shapes by default; the first axis counts arms or things. Poses are `x y z [m]`,
then quaternion wxyz."""
WHOLE: Any = {"break_long_words": False, "break_on_hyphens": False}
NO_EARLY_END = """\
 With dense rewards, which are never negative, an early end would pay less than waiting beside the goal: there, and in
the goal form, the episode continues after a success."""


class Page:
    """Docstring of environments: of one that is made its page, of the class the class's own text.

    Args:
        text: of the class.
    """

    def __init__(self, text: str):
        self._text = text

    def __get__(self, env: Any, kind: type) -> str:
        if env is None:
            return self._text
        facts = env.declared.facts
        return f"{facts.page.summary}\n\n{page_of(facts, env.boxes, env.arms[0].dof, len(env.arms))}"


def page_of(facts: TaskFacts, observation: Mapping[str, Any], joints: int, arms: int) -> str:
    """Return the Markdown page of an environment, from its first section on.

    Args:
        facts: about its task.
        observation: boxes of its observation by key, not in the goal form.
        joints: number of joints of an arm.
        arms: number of arms.
    """
    page, known = facts.page, dict(signature(named(facts.entry_point)).parameters)
    goals = f"\n\n{GOAL_FORM.format(goals=page.goals)}" if page.goals else ""
    levels = LEVELS.format(blocked=page.blocked) if page.blocked else TOO_SHORT
    short = "end_on_success" in known
    success = "with a settled success" + (" where `end_on_success` says so" if short else "")
    ends = f"`terminated` {success}{f', or {page.ends}' if page.ends else ''}."
    limit = f" `truncated` after {facts.seconds:g} s, {facts.steps} actions (Gymnasium's `TimeLimit`)."
    sections = {
        "Description": page.description,
        "Action Space": _actions(known["control_mode"].default, facts.frequency, joints, arms),
        "Observation Space": _observations(page.observed, observation) + goals,
        "Rewards": f'`reward="dense"`: in [0, 1], {page.dense}. `reward="sparse"`: 1 with success, else 0.',
        "Starting State": f"By `level`: {page.start}\n\n{levels}",
        "Episode End": ends + limit + (NO_EARLY_END if short else ""),
        "Info": f"{NUMBERS}, {page.numbers}.",
        "Arguments": _arguments(known, page.arguments, {**OPTIONS, **page.options}),
        "Version History": "* v0: first version.",
    }
    return "\n\n".join(f"## {title}\n{_wrapped(text)}" for title, text in sections.items())


def _wrapped(text: str) -> str:
    """Return a text with its lines filled, but for tables and lists."""
    parts = text.split("\n\n")
    return "\n\n".join(each if each[:1] in "|-*" else fill(" ".join(each.split()), WIDTH, **WHOLE) for each in parts)


def _table(head: tuple[str, ...], rows: Iterable[tuple[str, ...]]) -> str:
    lines = [f"| {' | '.join(cells)} |" for cells in (head, *rows)]
    return "\n".join([lines[0], f"|{'---|' * len(head)}", *lines[1:]])


def _actions(default: str, frequency: int, joints: int, arms: int) -> str:
    sizes = {"joint_velocity": arms * (joints + 1), "ee_twist": arms * 7}
    other = next(mode for mode in MODES if mode != default)
    text = f"`Box(-1, 1, ({sizes[default]},), float64)` at {frequency} Hz; "
    text += f'`({sizes[other]},)` with `control_mode="{other}"`'
    rows = [(f"`{mode}`", *row) for mode in (default, other) for row in MODES[mode]] + [("both", "last", GRIPPER)]
    cells = [(mode, entry.format(last=joints - 1), meaning) for mode, entry, meaning in rows]
    which = f"; these are for an arm of {joints} joints." if arms == 1 else "; right arm first, these are of each arm."
    return f"{text}{which}\n\n{_table(('control mode', 'entry', 'meaning'), cells)}"


def _observations(own: Mapping[str, str], boxes: Mapping[str, Any]) -> str:
    keys = [key for key in ENTRIES if key in boxes or key in own]
    meanings = {key: own.get(key) or ENTRIES[key] for key in keys}
    meanings["goal_pose"] += "; constant during an episode"
    shapes = {key: str(box.shape) for key, box in boxes.items()}
    rows = [(f"`{key}`", shapes.get(key, ""), meanings[key]) for key in keys]
    return f"{OBSERVED}\n\n{_table(('key', 'shape', 'meaning'), rows)}"


def _arguments(known: Mapping[str, Parameter], own: Mapping[str, str], options: Mapping[str, str]) -> str:
    rows = []
    for key, parameter in known.items():
        if parameter.default is not Parameter.empty:
            default = f'"{parameter.default}"' if isinstance(parameter.default, str) else f"{parameter.default}"
            general = "" if key in own and key != "obstacles" else ARGUMENTS[key]
            rows.append((f"`{key}`", f"`{default}`", "; ".join(each for each in (general, own.get(key, "")) if each)))
    given = _table(("option", "meaning"), ((f"`{key}`", meaning) for key, meaning in options.items()))
    return f"{_table(('argument', 'default', 'meaning'), rows)}\n\n`reset(options=...)` takes:\n\n{given}"
