"""A round peg into a square hole with 1 mm of play, from one scripted demonstration.

onedemo run peg_in_hole:PEG_IN_HOLE level=L2
"""

import numpy as np

from onedemo.baselines import ScriptedMotion, Waypoint
from onedemo.envs import At, Fixture, Movable, Part, Range, Success, Task, Tolerance, register_task
from onedemo.planner import Box, Cylinder, Pose

RADIUS, LENGTH, PLAY = 0.014, 0.090, 0.001
SIDE, DEPTH, FLOOR = 0.090, 0.045, 0.005
"""Side of the block, depth of the hole, thickness of its bottom [m]."""
WIDE = 2.0 * RADIUS + PLAY
STEEL, BRASS = (0.45, 0.48, 0.53, 1.0), (0.80, 0.62, 0.28, 1.0)


def block() -> Fixture:
    """A block with a square hole: four walls and a bottom; its frame is on the table, below the hole."""
    wall, high = 0.5 * (SIDE - WIDE), FLOOR + 0.5 * DEPTH
    away = 0.5 * (WIDE + wall)
    long, short = Box((SIDE, wall, DEPTH)), Box((wall, WIDE, DEPTH))
    walls = [Part(long, (0, away, high)), Part(long, (0, -away, high))]
    walls += [Part(short, (away, 0, high)), Part(short, (-away, 0, high))]
    return Fixture("block", (*walls, Part(Box((SIDE, SIDE, FLOOR)), (0, 0, 0.5 * FLOOR))), friction=0.4, color=STEEL)


def script(observation):
    """Fetch the peg, lift it, bring it above the hole, push it in, let go and withdraw."""
    peg = Pose.from_vector(observation["object_pose"][0])
    hole = Pose.from_vector(observation["goal_pose"][0])
    hand = Pose.from_position_quaternion([0, 0, 0.25 * LENGTH], (0, 1, 0, 0))

    def up(height, pose):
        return Pose.from_position_quaternion([0, 0, height]) @ pose

    grasp, release = peg @ hand, up(0.004, hole @ hand)
    yield ScriptedMotion("approach", (Waypoint(up(0.08, grasp)), Waypoint(grasp, 0.1)), "peg", gripper=1.0)
    yield ScriptedMotion("lift", (Waypoint(up(0.10, grasp), 0.15),), held="peg")
    yield ScriptedMotion("carry", (Waypoint(up(0.07, release)),), "block", held="peg")
    yield ScriptedMotion("insert", (Waypoint(release, 0.05),), "block", held="peg", gripper=-1.0)
    yield ScriptedMotion("withdraw", (Waypoint(up(0.10, release), 0.15),), "block")


PEG_IN_HOLE = Task(
    name="peg_in_hole",
    summary="Put a round peg into a square hole that is 1 mm wider.",
    objects=(Movable("peg", Cylinder(RADIUS, LENGTH), friction=0.4, color=BRASS),),
    fixtures=(block(),),
    start={
        "peg": Range((-0.05, -0.16), shift=(0.05, 0.10)),
        "block": Range((0.0, 0.12), shift=(0.05, 0.10), turn=(np.deg2rad(20), np.deg2rad(45))),
    },
    goals={"peg": At("block", (0, 0, FLOOR + 0.5 * LENGTH))},
    success=Success({"peg": Tolerance(xy=0.002, z=0.003, angle=np.deg2rad(3))}),
    demonstration="peg_in_hole.npz",
    script=script,
)
register_task(PEG_IN_HOLE)
