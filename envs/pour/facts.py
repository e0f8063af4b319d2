"""Facts about pouring: with one arm, with two, and from a glass that is in the hand."""

from __future__ import annotations

from ..facts.task_facts import Error, SegmentPlayback, TaskFacts, TaskPage

SOURCE, TARGET = 0, 1
"""Indices of the two glasses."""
OUTSIDE = Error("fraction_outside", "largest share of beads outside", "%", 1e2)
BEADS_LOST = {"beads_lost": "beads_lost", "share_outside": "fraction_outside"}
NUMBERS = """\
`fraction_in_target`, `fraction_outside`, `carry_tilt` [rad] (largest tilt of the lifted source before its rim came
within 15 cm of the target's axis) and `beads_lost` (most beads outside both glasses until then)"""
ENDS = "when a glass has fallen off the table, or when more than 5 % of the beads lie on it or below"
DONE = """\
half a second at least 90 % of the beads are in the target and at most 5 % outside both glasses, and the target is
upright and at rest."""
FURTHER = {
    "object_pose": "source and target; a glass's frame is at the center of its axis, z up",
    "goal_pose": "center of the target's rim at the start",
    "bead_fraction": "share of the beads in the source, in the target, outside both",
}
STANDS = "stands of source and target, from the center of their tops; constant during an episode"
POURED = "half of it the share of the beads in the target, the other half for"

POUR = TaskFacts(
    "pour",
    "onedemo/Pour-v0",
    "onedemo.envs.pour.pour_env:pour_env",
    40.0,
    TaskPage(
        summary="Pour the beads of one glass into another with one arm.",
        description=f"""\
Two glasses stand on stands on a table: the source (60 mm wide, 100 mm high, 80 g; 46 mm wide for grippers that hold
or clear no wider one) with 30 beads of 12 mm and 1 g that represent water, and the target (86 mm wide, 100 mm high).
The source must be fetched, carried and emptied into the target. Only friction holds it between the fingers, and the
beads move by gravity. Success is judged from the simulator: for {DONE}""",
        dense=f"{POURED} reaching, holding and carrying the source, kept once beads are poured; 1 with success",
        start="""\
L0 the robot's nominal places; L1 the source moved by up to 5 cm and the target by up to 10 cm in x and y, start
joints by up to 0.05 rad; L2 by 15 cm, 20 cm and 0.15 rad, each stand 10 to 30 cm high instead of 15. The glasses'
axes are at least 20 cm apart and 0.35 to 0.72 m from the arm's base axis, the arm at least 3 cm from everything. No
yaw is drawn: a round glass has none. With `pregrasped=True` the fingers are closed around the source on its stand.""",
        ends=ENDS,
        observed={
            **FURTHER,
            "furniture_pose": STANDS,
            "motion_index": "0 while the source is to be fetched, 1 while it is held, 2 while enough beads are poured",
        },
        numbers=NUMBERS,
        arguments={
            "robot": "those of `onedemo.envs.pour.places.POUR_PLACES`; of Baxter the right arm",
            "pregrasped": "whether the fingers are closed around the source at the start",
            "stands": "(2, 3) nominal x, y, z [m] of the stands' tops, source first; None: the robot's own",
            "ready": "(7,) nominal start joints [rad]; None: the robot's own",
        },
        options={"stands": "(2, 3) exact tops of the stands"},
        blocked="the path of hand and source from its stand to the target",
    ),
    error=OUTSIDE,
    task_metrics=BEADS_LOST,
    compared_segment="carry",
    poured_into=TARGET,
    upright=True,
    skill_at="onedemo.envs.pour.skill:POUR_SKILL",
    recorder="onedemo.baselines.recording.record_pour:record_pour",
)

TILT_POUR = TaskFacts(
    "tilt_pour",
    "onedemo/TiltPour-v0",
    "onedemo.envs.pour.tilt_pour_env:tilt_pour_env",
    7.5,
    TaskPage(
        summary="Empty the glass in the hand into the one in front of it.",
        description=f"""\
The source glass, with 30 beads of 12 mm and 1 g that represent water, is in the hand, upright, in front of and above
the target glass, held only by friction between the fingers. It must be tilted so that the beads fall into the target.
Success is judged from the simulator as in `onedemo/Pour-v0`: for {DONE}""",
        dense=f"{POURED} holding the source over the target and tilting it there",
        start="""\
the target stands as in `onedemo/Pour-v0`, moved by up to 10 cm (L1) or 20 cm and 10 to 30 cm high (L2); the source's
lip is 6 cm behind the pour point and 8 cm above it, moved by up to 3 cm (L1) or 6 cm (L2) in x, y and z. L0 is the
nominal place.""",
        ends=ENDS,
        observed={
            **FURTHER,
            "furniture_pose": STANDS,
            "motion_index": "1 while the source is held, 2 while enough beads are poured, 0 once it is released",
        },
        numbers=NUMBERS,
        options={"stands": "(2, 3) exact tops of the stands", "joint_positions": "(7,), which the glass follows"},
        goals="(2,): shares of the beads in the target and outside both glasses; 1 and 0",
    ),
    frequency=20,
    error=OUTSIDE,
    task_metrics=BEADS_LOST,
    compared_segment="carry",
    poured_into=TARGET,
    upright=True,
    demonstrated_task="pour",
    skill_at="onedemo.envs.pour.skill:POUR_SKILL",
    playback=SegmentPlayback("carry", "as shown", TARGET, {"hold": 2.0, "withdraw": 0.0}),
)

BIMANUAL_POUR = TaskFacts(
    "bimanual_pour",
    "onedemo/BimanualPour-v0",
    "onedemo.envs.pour.bimanual_pour_env:bimanual_pour_env",
    40.0,
    TaskPage(
        summary="Pour the beads of one glass into another, each held by one arm of Baxter from the start.",
        description=f"""\
The right hand holds the source (46 mm wide, 120 mm high, 80 g) with 30 beads of 12 mm and 1 g that represent water,
the left hand the target (54 mm wide, 100 mm high). Only friction holds the glasses between the fingers, and the beads
move by gravity. The place of pouring is free. Success is judged from the simulator: for {DONE} Contacts of an arm
with itself are ignored.""",
        dense=f"{POURED} holding the source and bringing it to the target, kept once beads are poured; 1 with success",
        start="""\
the glasses are upright in the hands. L0 the nominal places; L1 each glass moved by up to 5 cm in x, y and z and its
hand turned by up to 15 degrees about the vertical; L2 by 15 cm and 60 degrees. A start is drawn anew if an arm cannot
reach it from its ready posture with 0.1 rad to all joint limits and 3 cm to trunk and table, or if the glasses are
less than 22 cm apart.""",
        ends=ENDS,
        observed={**FURTHER, "motion_index": "1 while the source is held, 2 while enough beads are poured"},
        numbers=NUMBERS,
        arguments={"robot": "one with two arms: Baxter"},
        options={"joint_positions": "(2, 7), which must hold the glasses upright"},
        blocked="the source's straight path to the target's initial place",
    ),
    error=OUTSIDE,
    task_metrics=BEADS_LOST,
    poured_into=TARGET,
    upright=True,
    demonstrated_task="pour",
    skill_at="onedemo.envs.pour.skill:BIMANUAL_SKILL",
)
