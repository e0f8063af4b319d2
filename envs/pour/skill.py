"""Meaning of the segments of the pouring demonstration.

The source is fetched and lifted, carried and tilted over the rim of the target, held until it is empty, and turned
upright again. A glass that moves faster slips, and lags behind its guarded pose.
"""

from __future__ import annotations

from ...planner.skills.skill import THING, SegmentedSkill, SegmentMeaning

SLOW = {"speed": 0.5}
NEAR = {"touch_within": 0.02}
POURED = {"must_keep": True, "keeping": "free", "tries": 3, "pause": "drain"}
APPROACH = SegmentMeaning(
    "approach",
    "reach",
    THING,
    (("fingers", THING), ("hand", THING)),
    gripper="close",
    turns="round",
    how={**SLOW, **NEAR},
)
LIFT = SegmentMeaning("lift", "lift", touch=(("held", "source_stand"),), optional=True, rise=0.08, how=SLOW)
CARRY = SegmentMeaning(
    "carry",
    "carry",
    "target",
    (("held", "target"),),
    turns="round",
    sized=("source", "target"),
    how={**SLOW, **NEAR, **POURED},
)
RETURN = SegmentMeaning("return", "leave", touch=(("held", "target"),), how=SLOW)
POUR_SKILL = SegmentedSkill((APPROACH._replace(optional=True), LIFT, CARRY, RETURN._replace(optional=True)))
BIMANUAL_SKILL = SegmentedSkill((APPROACH, CARRY, RETURN))
