"""A ring over a peg, from one scripted demonstration.

onedemo run ring_on_peg:RING_ON_PEG level=L2
"""

import numpy as np

from onedemo.baselines import ScriptedMotion, Waypoint
from onedemo.envs import At, Fixture, Movable, Part, Range, Success, Task, Tolerance, register_task
from onedemo.planner import Box, Cylinder, Pose

INNER, OUTER, HIGH, STAVES = 0.0130, 0.0300, 0.020, 8
"""Radii and height of the ring [m], and the number of boxes that it consists of."""
PEG, TALL, BASE = 0.0100, 0.040, 0.010
"""Radius and length of the peg, thickness of its base [m]."""
RED, PALE = (0.80, 0.26, 0.20, 1.0), (0.87, 0.80, 0.66, 1.0)


def ring() -> Movable:
    """A ring of boxes; its frame is in the middle."""
    angles = 2.0 * np.pi * np.arange(STAVES) / STAVES
    middle, wide = 0.5 * (INNER + OUTER), 2.0 * OUTER * np.tan(np.pi / STAVES)
    stave = Box((OUTER - INNER, wide, HIGH))
    parts = [
        Part(stave, (middle * np.cos(a), middle * np.sin(a), 0.0), (np.cos(a / 2), 0.0, 0.0, np.sin(a / 2)))
        for a in angles
    ]
    return Movable("ring", parts, color=RED, yaw_symmetry=2 * np.pi / STAVES)


def stand() -> Fixture:
    """A peg on a base; its frame is on the table, below the peg."""
    peg = Part(Cylinder(PEG, TALL), (0.0, 0.0, BASE + 0.5 * TALL))
    return Fixture("stand", (Part(Box((0.09, 0.09, BASE)), (0.0, 0.0, 0.5 * BASE)), peg), color=PALE)


def script(observation):
    """Fetch the ring, lift it, bring it above the peg, lower it, let go and withdraw."""
    ring = Pose.from_vector(observation["object_pose"][0])
    goal = Pose.from_vector(observation["goal_pose"][0])
    hand = Pose.from_position_quaternion([0, 0, 0.002], (0, 1, 0, 0))

    def up(height, pose):
        return Pose.from_position_quaternion([0, 0, height]) @ pose

    grasp, release = ring @ hand, up(0.003, goal @ hand)
    yield ScriptedMotion("approach", (Waypoint(up(0.08, grasp)), Waypoint(grasp, 0.1)), "ring", gripper=1.0)
    yield ScriptedMotion("lift", (Waypoint(up(0.12, grasp), 0.15),), held="ring")
    yield ScriptedMotion("carry", (Waypoint(up(0.07, release)),), "stand", held="ring")
    yield ScriptedMotion("lower", (Waypoint(release, 0.08),), "stand", held="ring", gripper=-1.0)
    yield ScriptedMotion("withdraw", (Waypoint(up(0.12, release), 0.15),), "stand")


RING_ON_PEG = Task(
    name="ring_on_peg",
    summary="Put a ring over a peg.",
    objects=(ring(),),
    fixtures=(stand(),),
    start={
        "ring": Range((-0.05, 0.15), shift=(0.05, 0.10)),
        "stand": Range((0.02, -0.12), shift=(0.05, 0.10), turn=(np.deg2rad(20), np.deg2rad(45))),
    },
    goals={"ring": At("stand", (0, 0, BASE + 0.5 * HIGH))},
    success=Success({"ring": Tolerance(xy=0.005, z=0.003, angle=np.deg2rad(3))}),
    demonstration="ring_on_peg.npz",
    script=script,
)
register_task(RING_ON_PEG)
