"""Meaning of the segments of the stacking demonstration: a block is fetched, and let go above its goal."""

from __future__ import annotations

from ...planner.skills.skill import PREVIOUS, TASK_GOAL, THING, SegmentedSkill, SegmentMeaning

TOUCH = (("fingers", PREVIOUS), ("fingers", THING), ("held", "table"), ("held", PREVIOUS))
STACK_SKILL = SegmentedSkill(
    (
        SegmentMeaning("approach", "reach", THING, TOUCH, gripper="close", turns="thing"),
        SegmentMeaning("transfer", "carry", TASK_GOAL, TOUCH, gripper="open", turns="thing", trimmed=True),
    ),
    each=True,
)
REACH_SKILL = SegmentedSkill((SegmentMeaning("approach", "reach", TASK_GOAL, turns="hand"),))
