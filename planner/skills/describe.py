"""A skill in words: one line per phase, with its evidence and what is left open."""

from __future__ import annotations

from ..geometry.pose import Pose
from .skill import START, Phase, Skill


def described(skill: Skill) -> list[tuple[str, tuple[str, ...]]]:
    """Return a line for each phase of a skill, and the lines that belong below it."""
    lines = []
    for phase in skill.phases:
        below = [*phase.evidence]
        below += [
            f"it may be relative to {' or '.join(choice.others)} as well"
            for choice in skill.choices
            if choice.phase == phase.name
        ]
        lines.append((f"{phase.name}: {_end(phase)}", tuple(below)))
    return lines


def _end(phase: Phase) -> str:
    words = [f"ends {_where(phase)}", *_alike(phase)]
    if phase.exact:
        words.append("followed as it is, in contact")
    if phase.gripper != "none":
        words.append(f"then the gripper {phase.gripper}s")
    return ", ".join(words)


def _where(phase: Phase) -> str:
    if phase.reference == START:
        return f"{_moved(phase.goals[0])} from where it began"
    return f"relative to {phase.reference}"


def _moved(pose: Pose) -> str:
    x, y, z = (1e3 * value for value in pose.position)
    return f"({x:.0f}, {y:.0f}, {z:.0f}) mm"


def _alike(phase: Phase) -> list[str]:
    count = len(phase.left) * len(phase.right)
    return [f"{count} turns look alike"] if count > 1 else []
