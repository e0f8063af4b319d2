"""Facts about a demonstration: where the tool points, how fast it moves, what its motions refer to."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from ...planner import Demonstration, Pose, Segment
from ...planner.errors import BadDemonstration, UnknownName
from ...planner.geometry.dualquat import screw_parameters
from ...planner.imitation.demonstration_files import UNITS
from ...planner.skills.describe import described
from ...planner.skills.infer import infer_skill
from ...planner.skills.skill import Skill
from .robot_checks import robot_facts

DIRECTIONS = {"up": (0, 0, 1), "down": (0, 0, -1), "+x": (1, 0, 0), "-x": (-1, 0, 0), "+y": (0, 1, 0), "-y": (0, -1, 0)}
WITHOUT_SHAPES = "skill, by what moved (in a task the shapes of things make it sharper):"
STRAIGHT = 0.02
"""Turn [rad] below which a motion is called straight: its pitch would be a matter of noise."""


def pointing(pose: Pose) -> str:
    """Return where the z axis of a tool points, in words."""
    axis = pose.rotation[:, 2]
    name = max(DIRECTIONS, key=lambda word: float(np.dot(DIRECTIONS[word], axis)))
    off = np.degrees(np.arccos(np.clip(np.dot(DIRECTIONS[name], axis), -1.0, 1.0)))
    along = name if name in ("up", "down") else f"along {name}"
    return f"{along}, {off:.0f} deg off" if off >= 0.5 else along


def speeds(demonstration: Demonstration) -> str:
    """Return how fast the tool moves, in words."""
    steps = np.diff(demonstration.time)
    meters = np.linalg.norm(np.diff(demonstration.path.positions, axis=0), axis=1) / steps
    angles = np.degrees(
        [screw_parameters((one.inverse() @ other).dq).angle for one, other in _pairs(demonstration)] / steps
    )
    k = int(meters.argmax())
    return (
        f"{np.median(meters):.3f} m/s in the median, at most {meters[k]:.2f} m/s at "
        f"{demonstration.time[k] - demonstration.time[0]:.2f} s and {angles.max():.0f} deg/s"
    )


def _pairs(demonstration: Demonstration) -> list[tuple[Pose, Pose]]:
    path = demonstration.path
    return [(path[k], path[k + 1]) for k in range(len(path) - 1)]


def facts(path: Path, demonstration: Demonstration) -> list[tuple[str, str]]:
    """Return the facts about a demonstration, each a word and what is to be said about it.

    Args:
        path: of its file.
        demonstration: the demonstration.

    Raises:
        BadDemonstration: its joints contradict its poses.
    """
    demo, first = demonstration, demonstration.path[0]
    seconds = f"{demo.duration:.2f} s, {len(demo.path)} samples, {(len(demo.path) - 1) / demo.duration:.4g} per second"
    found = [
        ("file", str(path)),
        ("length", f"{seconds}, {demo.path.lengths()[-1]:.2f} m (screw)"),
        ("tool", f"{demo.tcp_frame}, units {UNITS}; it points {pointing(first)} at first"),
        ("speed", speeds(demo)),
        *robot_facts(path, demo),
        (
            "gripper",
            "not recorded" if demo.gripper is None else "closed at first" if demo.gripper[0] > 0 else "open at first",
        ),
    ]
    objects = [_object(demo, name) for name in dict.fromkeys([*demo.object_paths, *demo.fixtures, *demo.object_sizes])]
    found += [("objects", "; ".join(objects))] if objects else []
    found += [("others", f"joints {', '.join(demo.other_joints)}")] if demo.other_joints else []
    found += [("commands", "the commanded path is recorded, too")] if demo.commanded is not None else []
    return [*found, ("licence", demo.licence)]


def _object(demo: Demonstration, name: str) -> str:
    size = demo.object_sizes.get(name)
    words = [] if size is None else [" x ".join(f"{1e3 * value:.0f}" for value in size) + " mm"]
    if name in demo.fixtures:
        x, y, z = demo.fixtures[name].position
        words.append(f"stands at {x:.3f} {y:.3f} {z:.3f} m")
    elif name in demo.object_paths:
        positions = demo.object_paths[name].positions
        words.append(f"is moved by {np.linalg.norm(positions - positions[0], axis=1).max():.3f} m")
    return f"{name} ({', '.join(words)})" if words else name


def segment_lines(demonstration: Demonstration, segment: Segment) -> list[str]:
    """Return what a segment does, how it ends, and the screw motion from its first to its last pose.

    Args:
        demonstration: the demonstration.
        segment: one of its segments.
    """
    first, last = demonstration.path[segment.start], demonstration.path[segment.stop]
    screw = screw_parameters((last @ first.inverse()).dq)
    x, y, z = screw.axis
    axis = f"({x:+.2f} {y:+.2f} {z:+.2f})"
    carries = f"carries {segment.held}, " if segment.held else ""
    then = {"close": ", then the gripper closes", "open": ", then the gripper opens"}.get(segment.gripper, "")
    since = demonstration.time - demonstration.time[0]
    window = f"{since[segment.start]:.2f} to {since[segment.stop]:.2f} s, samples {segment.start} to {segment.stop}"
    lines = [f"{window}: {carries}ends relative to {segment.reference or 'the world'}{then}"]
    if segment.reference:
        gap = last.position - segment.reference_pose.position
        away = " ".join(f"{1e3 * value:+.0f}" for value in gap)
        lines.append(f"at its end the tool points {pointing(last)}, {away} mm (x y z) from {segment.reference}")
    else:
        lines.append(f"at its end the tool points {pointing(last)}")
    if screw.angle > STRAIGHT:
        pitch = screw.travel / screw.angle
        turn = (
            f"{np.degrees(screw.angle):.1f} deg about {axis}, {screw.travel:+.3f} m along it, pitch {pitch:+.3f} m/rad"
        )
        return [*lines, f"screw: {turn}"]
    return [
        *lines,
        f"screw: {np.linalg.norm(last.position - first.position):.3f} m, turn of {np.degrees(screw.angle):.1f} deg",
    ]


def skill_lines(demonstration: Demonstration, task: str = "") -> list[str]:
    """Return the skill that a demonstration shows, in words, a line for each phase and what is known about it.

    Args:
        demonstration: the demonstration.
        task: dotted path of a user's own task, whose shapes make references and symmetries sharper; "": none.

    Raises:
        UnknownName, BadConfig: no such task.
    """
    if task:
        return lines_of(skill_in_task(demonstration, task), f"skill, in {task}:")
    if not demonstration.object_paths and not demonstration.other_joints:
        return []
    try:
        skill = infer_skill(demonstration)
    except BadDemonstration as error:
        return [f"skill: none is found: {error.key} {error.reason}"]
    return lines_of(skill)


def skill_in_task(demonstration: Demonstration, path: str) -> Skill:
    """Return the skill in the words of a task, which is made for it.

    Args:
        demonstration: the demonstration.
        path: dotted path of a user's own task, or the name of a shipped one.

    Raises:
        UnknownName, BadConfig: no such task.
        BadDemonstration: no skill is found, or none whose things the task has.
    """
    import gymnasium as gym

    from ...baselines.programs.task_skills import skill_of
    from ...configs import BadConfig
    from ...envs import TASKS, facts_of
    from ...envs.dotted_names import BadDottedName, is_dotted

    if not is_dotted(path) and path not in TASKS:
        raise UnknownName("task", path, (*TASKS, "my_tasks:MY_TASK"))
    try:
        env: Any = gym.make(facts_of(path, load=True).id)
    except BadDottedName as error:
        raise BadConfig("--task", path, error.reason) from None
    try:
        return skill_of(demonstration, env.unwrapped.task)
    finally:
        env.close()


def lines_of(skill: Skill, head: str = WITHOUT_SHAPES) -> list[str]:
    """Return a skill in words, a line for each phase and what is known about it.

    Args:
        skill: the skill.
        head: first line.
    """
    lines = [head]
    for line, below in described(skill):
        lines += [f"  {line}", *(f"    {text}" for text in below)]
    return [*lines, *(f"  {note}" for note in skill.notes)]
