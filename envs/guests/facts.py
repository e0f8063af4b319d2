"""Facts about the environment of robosuite's tasks."""

from __future__ import annotations

from ..facts.task_facts import TaskFacts, TaskPage

ROBOSUITE = TaskFacts(
    "robosuite",
    "onedemo/Robosuite-v0",
    "onedemo.envs.guests.robosuite_env:robosuite_env",
    60.0,
    TaskPage(
        summary="""\
One of robosuite's tasks for one arm, at this project's control, with its obstacles and robosuite's judge.""",
        description="""\
`task` is one of robosuite's names: Lift, Stack, NutAssembly, NutAssemblySingle, NutAssemblySquare, NutAssemblyRound,
PickPlace, PickPlaceSingle, PickPlaceMilk, PickPlaceBread, PickPlaceCereal, PickPlaceCan, Door, ToolHang, or a task
for one arm that you have registered with robosuite. Model, placement and success are robosuite's own; the arm has the
velocity servos of the other environments here. Success is judged from the simulator: robosuite's `_check_success`
holds for half a second.

The objects of `task.objects` are the free bodies that take part, each with its convex solids `parts`. Objects that
robosuite hides stand on the floor beside the scene: left out where it is always the same ones, kept where each
episode draws which one takes part. The table is the fixture "table"; all else that is solid and not free (pegs, bins,
the door, its frame and its latch) is `task.furniture`. Parts of a whole, like those of the door, name it as their
`assembly`; its own frame, without solids, is in the list, too. Joints of the scene are named in
`task.scene_joints`.""",
        dense="robosuite's own shaped reward, scaled; ToolHang has none",
        start="""\
L0, L1, L2, R, S and T start alike. By `range`: D0 is robosuite's own placement, D1 a wider one: in Stack both cubes
within 20 cm of the table's middle in x and y; in NutAssemblySquare the nut within 11.5 cm in x and 25.5 cm in y with
any yaw, its peg at x from -0.1 to 0.3 m and y from -0.2 to 0.2 m, where nut and pegs are 14 cm apart. The objects are
dropped as in robosuite and settle for 0.4 s before the first observation. The arm starts at rest at its home joints,
gripper open, without noise.""",
        ends="when an object has fallen off the table",
        observed={
            "goal_pose": "robosuite's tasks have no goal poses",
            "motion_index": "1 while the fingers touch an object, else 0",
            "furniture_pose": "poses of the fixtures; only where there are any",
            "scene_joint_positions": "of the scene's joints [rad or m]; only where there are any",
        },
        numbers="`robosuite_success` (`_check_success` at this instant)",
        arguments={
            "task": "robosuite's name of the task",
            "robot": "any with one arm",
            "gripper": "of a Sawyer also RethinkGripper",
            "range": '"D0" or "D1"',
        },
        options={"object_poses": "(n, 7), which do not settle"},
        blocked="""\
the way from above an object to above its place, or from the start to what the hand moves (where that way is short, as
in Stack at D0, none fits, and the reset is refused by `NoRoom`)""",
    ),
    error=None,
)
