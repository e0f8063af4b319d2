"""Picture of a skill: when what moved, and where each motion ends relative to what."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...planner import Demonstration, Pose
from ...planner.skills.articulations import FINGERS, Articulation, articulations
from ...planner.skills.grips import Grip, closings, grips
from ...planner.skills.skill import START, Phase, Skill
from ...planner.skills.slides import slides_from
from ..drawing.figure_style import DOTS, FAINT, INK, legend_above, styled

WIDTH, TIMES, PANEL = 7.0, 1.9, 2.0
"""Width of the figure, and heights of the timeline and of a row of panels [inch]."""
COLUMNS = 4
"""Largest number of panels in a row."""
ENTRIES = 4
"""Number of the legend's entries in a row."""
MOVES = 0.01
"""Displacement [m] from which an object is drawn as one that moves."""
LINES = ("#1f4fd8", "#b5179e", "#007f5f", "#b35c00", "#5f3dc4", "#5c5c00")
DASHES = ("--", ":", "-.")
PART = re.compile(r" part \d+$")
"""End of the name of a phase that is one of several of a push."""
FACES = {"reach": "#e6eefc", "carry": "#fbe6f6", "slide": "#fdf0dc", "articulate": "#fdf0dc", "withdraw": "#efefef"}
MILLIMETERS = 1e3
EDGE = 0.07
"""Share of the timeline at its ends in which no name has its middle."""


OBJECTS = ("carry", "slide")
"""Kinds of phases in which an object is what moves."""


class Span(NamedTuple):
    """Times [s] of a phase."""

    name: str
    kind: str
    start: float
    stop: float


def draw_skill(demonstration: Demonstration, skill: Skill, file: Path) -> None:
    """Draw a skill.

    Above, how far every object was from where it began, the phases, and when the hand was closed; below, from the side,
    the path of what moved in each phase that ends relative to something.

    Args:
        demonstration: the demonstration.
        skill: found in it.
        file: .png, .pdf or .svg.
    """
    from matplotlib.figure import Figure

    ending = [phase for phase in skill.phases if phase.kind != "withdraw"]
    columns = max(min(len(ending), COLUMNS), 1)
    rows = -(-len(ending) // columns)
    with styled():
        figure = Figure(figsize=(WIDTH, TIMES + PANEL * rows), layout="constrained")
        grid = figure.add_gridspec(1 + rows, columns, height_ratios=[TIMES, *[PANEL] * rows])
        axes = figure.add_subplot(grid[0, :])
        _draw_times(axes, demonstration, skill)
        legend_above(figure, *axes.get_legend_handles_labels(), ENTRIES)
        for k, phase in enumerate(ending):
            _draw_end(figure.add_subplot(grid[1 + k // columns, k % columns]), phase)
        figure.savefig(file, dpi=DOTS)


def spans_of(demonstration: Demonstration, skill: Skill) -> list[Span]:
    """Return the times of a skill's phases, since the first sample.

    Args:
        demonstration: the demonstration.
        skill: found in it.
    """
    since = demonstration.time - demonstration.time[0]
    held, _ = grips(demonstration)
    events = sorted([*held, *articulations(demonstration, held)], key=lambda event: event.held)
    begin, found, done = 0, [], []
    for event in events:
        done.append(event.name if isinstance(event, Grip) else event.reference or "the world")
        number = done.count(done[-1])
        moved = done[-1] if number == 1 else f"{done[-1]} ({number})"
        mine = [phase for phase in skill.phases if PART.sub("", phase.name).partition(" ")[2] == moved]
        edges = [begin, *_between(demonstration, event, mine), event.released]
        for phase, start, stop in zip(mine, edges, edges[1:], strict=False):
            found.append(Span(phase.name, phase.kind, float(since[start]), float(since[stop])))
        begin = event.released
    if skill.phases and skill.phases[-1].kind == "withdraw":
        found.append(Span("withdraw", "withdraw", float(since[begin]), float(since[-1])))
    return found


def _between(demonstration: Demonstration, event: Grip | Articulation, phases: list[Phase]) -> list[int]:
    """Return the samples at which one phase of a grip or a push ends and the next one begins."""
    if isinstance(event, Articulation):
        return sorted({event.held, *(sample for sample, _ in event.grips)})
    if not any(phase.kind == "slide" for phase in phases):
        return [event.held]
    carry = next(phase for phase in phases if phase.kind == "carry")
    begins = slides_from(demonstration, event, carry)
    return [event.held] if begins is None else [event.held, begins]


def _draw_times(axes: Any, demonstration: Demonstration, skill: Skill) -> None:
    since = demonstration.time - demonstration.time[0]
    paths = {name: path.positions for name, path in demonstration.object_paths.items()}
    ways = {name: np.linalg.norm(points - points[0], axis=1) for name, points in paths.items()}
    moved = [name for name in ways if ways[name].max() > MOVES]
    for k, name in enumerate(moved):
        axes.plot(since, ways[name], color=LINES[k % len(LINES)], linewidth=1.4, label=name)
    joints = {name: np.abs(values - values[0]) for name, values in demonstration.other_joints.items()}
    turned = [name for name in joints if joints[name].max() > MOVES and not FINGERS.search(name)]
    for k, name in enumerate(turned):
        axes.plot(since, joints[name], color=INK, linestyle=DASHES[k % len(DASHES)], label=f"{name} [rad or m]")
    top = axes.get_ylim()[1]
    for k, span in enumerate(spans_of(demonstration, skill)):
        axes.axvspan(span.start, span.stop, color=FACES[span.kind], zorder=0, linewidth=0)
        middle = np.clip(0.5 * (span.start + span.stop), EDGE * since[-1], (1.0 - EDGE) * since[-1])
        place = (float(middle), top * (1.02 + 0.13 * (k % 2)))
        at_edge = span.stop >= since[-1] and span.stop - span.start < 2.0 * EDGE * since[-1]
        place = (float(since[-1]), place[1]) if at_edge else place
        axes.text(*place, span.name, ha="right" if at_edge else "center", va="bottom", fontsize=6.5)
    if demonstration.gripper is not None:
        for closing in closings(demonstration.gripper):
            label = "hand closed" if closing.start == closings(demonstration.gripper)[0].start else None
            axes.plot(since[[closing.start, closing.stop]], [-0.04 * top] * 2, color=INK, linewidth=3.0, label=label)
    axes.set(xlim=(0.0, since[-1]), ylim=(-0.1 * top, 1.28 * top), xlabel="time [s]", ylabel="way from its start [m]")
    axes.grid(visible=False)


def _draw_end(axes: Any, phase: Phase) -> None:
    """Draw the path of the moving body from the side, relative to what its end refers to."""
    place = phase.path[-1] @ phase.goals[0].inverse() if phase.reference != START else phase.path[0]
    local = place.inverse()
    points = np.array([_from_the_side(local, pose, phase.path[0]) for pose in phase.path])
    goals = np.array([_from_the_side(local, place @ goal, phase.path[0]) for goal in phase.goals])
    if phase.reference == START:
        goals = points[-1:]
    color = LINES[1] if phase.kind in OBJECTS else LINES[0]
    axes.plot(*(MILLIMETERS * points.T), color=color, linewidth=1.4)
    axes.plot(*(MILLIMETERS * points[0]), "o", color=color, markerfacecolor="white")
    axes.plot(*(MILLIMETERS * goals.T), "x", color=color, markersize=5.0)
    axes.plot(0.0, 0.0, "+", color=INK, markersize=9.0, markeredgewidth=1.2)
    name = phase.reference if phase.reference != START else "where it began"
    axes.annotate(name, (0.0, 0.0), xytext=(5, 4), textcoords="offset points", fontsize=6.5, color=INK)
    count = len(phase.goals) * len(phase.left) * len(phase.right)
    body = "object" if phase.kind in OBJECTS else "hand"
    axes.set_title(f"{phase.name}\n{body}, {count} ends" if count > 1 else f"{phase.name}\n{body}", fontsize=7.0)
    axes.margins(0.12)
    axes.set(xlabel="aside [mm]", ylabel="above [mm]")
    axes.set_aspect("equal", adjustable="datalim")
    axes.tick_params(colors=FAINT)


def _from_the_side(local: Pose, pose: Pose, first: Pose) -> tuple[float, float]:
    """Return the position of a pose in an upright plane through the reference and where the motion began [m]."""
    origin = local.inverse().position
    toward = first.position[:2] - origin[:2]
    length = float(np.linalg.norm(toward))
    along = toward / length if length > 1e-6 else np.array([1.0, 0.0])
    gap = pose.position - origin
    return float(gap[:2] @ along), float(gap[2])
