"""Page of a user's own task, written from its data."""

from __future__ import annotations

import math

import numpy as np

from ...planner.geometry.hulls import corner_points
from ..scene.robots import ROBOTS
from ..scene.scene_objects import FixedShape
from .places import At, Range
from .task import Task

YAWS = np.arange(36) * np.pi / 36.0
ACROSS = np.array([np.cos(YAWS), np.sin(YAWS), np.zeros(len(YAWS))])
"""Directions (3, n) across which fingers that come from above may close."""


def described(task: Task) -> str:
    """Return, in Markdown, what is there in a task, where it stands by level, and when the task is done."""
    things = "| thing | | parts | size [mm] | where x, y [m] | moved at L1 | at L2 |\n|---|---|---|---|---|---|---|\n"
    rows = [("object", each.name, each.body.parts) for each in task.objects]
    rows += [("fixture", each.name, each.furniture.parts) for each in task.fixtures]
    things += "\n".join(_row(kind, name, parts, task.start[name]) for kind, name, parts in rows)
    goals = [f"- {_goal(task, name)}" for name in task.goals]
    done = "\n".join([*goals, *_conditions(task)])
    parts = [things, *_wide(task), "Done when, as the simulator shows it:", done]
    return "\n\n".join(parts)


def _wide(task: Task) -> list[str]:
    """Return a sentence on each object that a hand cannot close around from above."""
    opening, found = ROBOTS["Panda"].opening, []
    for each in task.objects:
        narrowest = min(np.ptp(_corners(each.body.parts) @ ACROSS, axis=0))
        if narrowest > opening:
            size = f"{1e3 * narrowest:.0f} mm wide where it is narrowest"
            found.append(f"{each.name} is {size}; a Panda's hand opens to {1e3 * opening:.0f} mm.")
    return found


def _corners(parts: tuple[FixedShape, ...]) -> np.ndarray:
    return np.vstack([corner_points(part.shape) @ part.pose.rotation.T + part.pose.position for part in parts])


def _row(kind: str, name: str, parts: tuple[FixedShape, ...], where: Range) -> str:
    size = " x ".join(f"{1e3 * value:.0f}" for value in np.ptp(_corners(parts), axis=0))
    place = f"{where.place[0]:g}, {where.place[1]:g}"
    return f"| {name} | {kind} | {len(parts)} | {size} | {place} | {_moved(where, 'L1')} | {_moved(where, 'L2')} |"


def _moved(where: Range, layout: str) -> str:
    (x, y), turn = where.reach(layout)
    words = [f"{1e3 * x:g} mm" if x == y else f"{1e3 * x:g}, {1e3 * y:g} mm"] if x or y else []
    return ", ".join([*words, *([f"{math.degrees(turn):.0f} deg"] if turn else [])]) or "no"


def _goal(task: Task, name: str) -> str:
    where, limits = task.goals[name], task.tolerance(name)
    there = f"at {where.thing}" if isinstance(where, At) else f"at its place, moved by {_moved(where, 'L2')} at L2"
    angle = f"{math.degrees(limits.angle):.0f} deg" if math.isfinite(limits.angle) else "any angle"
    return f"{name} is {there}: within {1e3 * limits.xy:g} mm across, {1e3 * limits.z:g} mm along, {angle}"


def _conditions(task: Task) -> list[str]:
    success, lines = task.success, []
    if task.goals:
        lines.append(f"- released, and the hand {1e3 * success.withdrawn:g} mm away")
    if success.also is not None:
        text = " ".join((success.also.__doc__ or "").split()).rstrip(".")
        lines.append(f"- and its own condition holds{f': {text[0].lower()}{text[1:]}' if text else ''}")
    lines.append(f"- all of it for {success.seconds:g} s, everything at rest")
    lines += [f"- it has failed as soon as: {reason}" for reason, _ in success.failed]
    return [*lines, f"- within {task.seconds:g} s"]
