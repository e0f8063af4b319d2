"""Facts about stacking, and about the single motions of reaching and placing."""

from __future__ import annotations

from ..facts.task_facts import SegmentPlayback, TaskFacts, TaskPage

STACKED = {"stack_offset": "position_error", "stack_yaw": "yaw_error"}
INDEX = "2k while block k is to be fetched, 2k + 1 while it is held, 2n when all are placed"
POSES = "(n, 7); a block in the hand is held there"

STACK = TaskFacts(
    "stack",
    "onedemo/Stack-v0",
    "onedemo.envs.stack.stack_env:stack_env",
    60.0,
    TaskPage(
        summary="Stack wooden blocks at a given place, in order, with one arm.",
        description="""\
Wooden blocks (60 x 40 x 50 mm, 72 g) lie on a table. Block 0 must be put at the base place, block 1 onto it, and so
on. Only friction holds them between the fingers. Success is judged from the simulator: for half a second every block
is within 10 mm horizontally, 10 degrees of yaw (a block looks the same after half a turn) and 5 mm in height of its
goal, touched by no finger and at rest, and the hand has withdrawn by 5 cm.""",
        dense="the completed share of the task, including reaching, grasping and carrying of the current block",
        start="""\
L0 the nominal row; L1 blocks moved by up to 10 cm and turned by up to 30 degrees, the base place by up to 5 cm, start
joints by up to 0.05 rad; L2 up to 20 cm, 120 degrees, 10 cm and 0.15 rad. Blocks are at least 12 cm apart, 17 cm from
the base place, and 0.32 to 0.70 m from the arm's base axis, where a Panda's hand can point straight down; blocks and
base place keep to a robot's own reach, `ROBOTS[robot].reach`, where it differs.""",
        ends="when a block has fallen off the table",
        observed={"object_pose": "poses of the blocks", "goal_pose": "goal of each block", "motion_index": INDEX},
        numbers="`blocks_placed`, `position_error` (n,) [m], `yaw_error` (n,) [rad]",
        arguments={"n_blocks": "number of blocks, 1 to 6", "obstacles": '"paper": one swings before the last block'},
        options={"object_poses": "(n, 7)", "base_pose": "(7,), goal of the lowest block"},
        blocked="the path of hand and block from above a block to above its goal",
    ),
    task_metrics=STACKED,
    compared_segment="transfer",
    upright=True,
    skill_at="onedemo.envs.stack.skill:STACK_SKILL",
)

REACH = TaskFacts(
    "reach",
    "onedemo/Reach-v0",
    "onedemo.envs.stack.reach_env:reach_env",
    7.5,
    TaskPage(
        summary="Bring the open hand above a block, ready to grasp it.",
        description="""\
A wooden block (60 x 40 x 50 mm) lies on a table. The hand's goal is 8 cm above the block's center, pointing straight
down, with the fingers on both sides of its narrow axis; half a turn of the hand makes no difference. Success is
judged from the simulator: the hand stays within 10 mm and 10 degrees of its goal for half a second.""",
        dense="closeness of the hand to its goal, 1 once it has been there for half a second",
        start="""\
L0 the nominal place; L1 the block moved by up to 10 cm and turned by up to 30 degrees, start joints by up to 0.05
rad; L2 up to 20 cm, 120 degrees and 0.15 rad.""",
        ends="",
        observed={
            "object_pose": "the block",
            "goal_pose": "goal of the hand",
            "motion_index": "0 on the way, 1 while the hand is within the tolerances",
        },
        numbers="`position_error` [m], `angle_error` [rad]",
        options={"object_poses": "(1, 7)"},
        goals="(7,): pose and goal of the tcp; reached within the tolerances",
        blocked="the hand's path",
    ),
    frequency=20,
    task_metrics={"reach_offset": "position_error"},
    demonstrated_task="stack",
    skill_at="onedemo.envs.stack.skill:REACH_SKILL",
    playback=SegmentPlayback("approach", "at the goal", 0, {"ending": "none", "withdraw": 0.0}),
)

PLACE_ONE = TaskFacts(
    "place_one",
    "onedemo/PlaceOne-v0",
    "onedemo.envs.stack.place_one_env:place_one_env",
    7.5,
    TaskPage(
        summary="Put the block in the hand at its goal, on the table or on another block.",
        description="""\
A wooden block (60 x 40 x 50 mm, 72 g) is in the hand, held only by friction between the fingers. It must be put at
its goal and released, and the hand withdrawn by 5 cm. Success is judged from the simulator as in `onedemo/Stack-v0`:
for half a second the block is within 10 mm horizontally, 10 degrees of yaw (a block looks the same after half a turn)
and 5 mm in height of its goal, touched by no finger and at rest.""",
        dense="up to 0.75 for bringing the held block to its goal, from 0.75 to 1 for withdrawing once it stands there",
        start="""\
L0 the nominal place; L1 the block moved by up to 10 cm and turned by up to 30 degrees, its goal by up to 5 cm and 30
degrees, held 8 to 16 cm above the table; L2 up to 20 cm, 10 cm, 120 degrees, 6 to 20 cm. With `pregrasped=False` the
block stands on the table and the hand is at its ready posture; give `max_episode_steps=300`.""",
        ends="when a block has fallen off the table",
        observed={
            "object_pose": 'with `onto="block"` the block already in place, then the one to place',
            "goal_pose": "goal of each block",
            "motion_index": INDEX,
        },
        numbers="`blocks_placed`, `position_error` (n,) [m], `yaw_error` (n,) [rad]",
        arguments={"onto": '"table" or "block"', "pregrasped": "whether the block is in the hand from the start"},
        options={"object_poses": POSES, "base_pose": "(7,), goal of the lowest block"},
        goals="(8,): pose of the block, and 1 once it is released and the hand is 5 cm away, else 0; its goal and 1",
        blocked="the block's path",
    ),
    frequency=20,
    task_metrics=STACKED,
    compared_segment="transfer",
    upright=True,
    demonstrated_task="stack",
    skill_at="onedemo.envs.stack.skill:STACK_SKILL",
    # the block starts above its place: the first half of the path comes from elsewhere
    playback=SegmentPlayback("transfer", "at its goal", -1, {"begin": 0.5}),
)
