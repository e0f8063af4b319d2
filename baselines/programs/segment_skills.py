"""The skill that a demonstration with named segments shows, in a task and at the start of an episode."""

from __future__ import annotations

from dataclasses import replace

from ...envs import ROBOTS, TaskDescription
from ...planner import Demonstration, Pose
from ...planner.errors import PlanFailed
from ...planner.skills.segments import Moved, phases_of
from ...planner.skills.skill import SegmentedSkill, Skill
from ..motion.settings import ProgramSettings
from ..policy import Observation
from .arm_executor import OPEN


def skill_of_segments(
    written: SegmentedSkill,
    demonstration: Demonstration,
    task: TaskDescription,
    settings: ProgramSettings,
    observation: Observation,
) -> Skill:
    """Return the phases of all things that are still to be moved.

    Args:
        written: what the segments mean.
        demonstration: with the segments.
        task: the task.
        settings: see `ProgramSettings`.
        observation: the first one: what was moved before, or is in the hand, is not fetched.

    Raises:
        PlanFailed: "plan_failed", nothing shows how the thing is held: it is neither reached nor in the hand.
    """
    done, in_hand = divmod(int(observation["motion_index"][0]), 2)
    hand = Pose.from_vector(observation["tcp_pose"][0])
    names = [each.name for each in task.objects]
    phases = []
    for k in range(done, len(observation["goal_pose"])) if written.each else [0]:
        held = hand.inverse() @ Pose.from_vector(observation["object_pose"][k]) if in_hand and k == done else None
        size, yaws = task.objects[k].size, task.objects[k].symmetric_yaws
        moved = Moved(names[k], size, yaws, names[k - 1] if k else "", tuple(names[:k] + names[k + 1 :]), held)
        phases += phases_of(written, demonstration, moved, settings.trim)
    phases = [replace(phase, opening=_opening(phase.opening, demonstration.robot, task)) for phase in phases]
    skill = Skill(demonstration.name, demonstration.robot, tuple(phases), in_hand=bool(in_hand))
    if not in_hand and phases[0].kind != "reach":
        raise PlanFailed("plan_failed", "the demonstration shows no approach, and the source is not in the hand")
    return skill


def _opening(action: float, robot: str, task: TaskDescription) -> float:
    """Return the action that opens this gripper as far as the demonstrated one.

    How wide an unknown robot's gripper opens is unknown: then the action itself is the demonstrated one.
    """
    if robot == task.robot or robot not in ROBOTS or not OPEN < action < 0.0:
        return action
    return max(action * ROBOTS[robot].opening / task.gripper_width[0], OPEN)
