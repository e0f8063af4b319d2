"""Meaning of the segments of the shelving demonstration.

A book is taken from the stand once it lies there, lifted, carried to the front of its slot, slid in and let go, and the
hand withdraws from between the books. A book that moves faster turns in the hand.
"""

from __future__ import annotations

from ...planner.skills.skill import DEMONSTRATED, OTHERS, TASK_GOAL, THING, SegmentedSkill, SegmentMeaning

HAND_AT = tuple((part, name) for part in ("fingers", "hand") for name in (THING, OTHERS))
SLOW = {"speed": 0.6}
SHELVE_SKILL = SegmentedSkill(
    (
        SegmentMeaning(
            "reach",
            "reach",
            THING,
            (("fingers", THING), ("hand", THING), ("fingers", "stand")),
            gripper="close",
            before="approach",
            how={"awaited_on": "stand"},
        ),
        SegmentMeaning("lift", "lift", touch=(("held", "stand"), ("fingers", "stand")), how=SLOW),
        SegmentMeaning(
            "insert",
            "carry",
            TASK_GOAL,
            (("held", "cupboard"), ("fingers", OTHERS), ("hand", OTHERS)),
            gripper=DEMONSTRATED,
            before="carry",
            how={**SLOW, "exact": True, "tries": 3, "clearance": 0.010},
        ),
        SegmentMeaning("retreat", "leave", touch=HAND_AT, how={**SLOW, "straight": 0.07}),
    ),
    each=True,
)
