"""A sponge wiped over four stains on a board, in contact, from one scripted demonstration.

onedemo run wipe_board:WIPE_BOARD level=L2
"""

import numpy as np

from onedemo.baselines import ScriptedMotion, Waypoint
from onedemo.envs import At, Fixture, Movable, Part, Range, Success, Task, Tolerance, register_task
from onedemo.planner import Box, Cylinder, Pose

SPONGE, BOARD, THIN = (0.060, 0.040, 0.035), (0.120, 0.260, 0.012), 0.0004
STAINS = (-0.045, -0.010, 0.025, 0.060)
"""Places of the stains on the board, along its middle line [m]."""
BEFORE, AFTER, PRESS = -0.080, 0.090, 0.0015
"""Where the stroke begins and ends on that line, and how far below the surface the hand is sent [m]."""
YELLOW, WHITE, INK = (0.93, 0.78, 0.25, 1.0), (0.90, 0.91, 0.92, 1.0), (0.15, 0.20, 0.45, 1.0)


def board() -> Fixture:
    """A board with stains; its frame is on the table, below the middle."""
    top = BOARD[2]
    stains = [Part(Cylinder(0.009, THIN), (0.0, y, top + 0.5 * THIN), color=INK) for y in STAINS]
    return Fixture("board", (Part(Box(BOARD), (0.0, 0.0, 0.5 * top)), *stains), friction=0.5, color=WHITE)


def on_board(y):
    """Return a place of the sponge on the board."""
    return At("board", (0, y, BOARD[2] + 0.5 * SPONGE[2]))


def wiped(scene) -> set:
    """Return the stains that the sponge has passed over in contact with the board, so far in the episode."""
    done = scene.memory.setdefault("wiped", set())
    if scene.touching("sponge", "board"):
        x, y, _ = (scene.pose("board").inverse() @ scene.pose("sponge")).position
        done.update(stain for stain in STAINS if abs(y - stain) < 0.010 and abs(x) < 0.012)
    return done


def stains_left(scene) -> int:
    """Return the number of stains that are left."""
    return len(STAINS) - len(wiped(scene))


def clean(scene) -> bool:
    """The sponge has passed over every stain in contact with the board."""
    return stains_left(scene) == 0


def script(observation):
    """Fetch the sponge, set it on the board, wipe, let go and withdraw."""
    sponge = Pose.from_vector(observation["object_pose"][0])
    board = Pose.from_vector(observation["furniture_pose"][0])
    hand = Pose.from_yaw([0, 0, 0.006], 0.5 * np.pi) @ Pose.from_position_quaternion([0, 0, 0], (0, 1, 0, 0))

    def above(y, height):
        return board @ Pose.from_position_quaternion([0, y, BOARD[2] + 0.5 * SPONGE[2] + height]) @ hand

    def up(height, pose):
        return Pose.from_position_quaternion([0, 0, height]) @ pose

    grasp, start, end = sponge @ hand, above(BEFORE, -PRESS), above(AFTER, -PRESS)
    yield ScriptedMotion("approach", (Waypoint(up(0.08, grasp)), Waypoint(grasp, 0.1)), "sponge", gripper=1.0)
    yield ScriptedMotion("lift", (Waypoint(up(0.08, grasp), 0.15),), held="sponge")
    yield ScriptedMotion("carry", (Waypoint(up(0.05, start)), Waypoint(start, 0.05)), "board", held="sponge")
    yield ScriptedMotion("wipe", (Waypoint(end, 0.08),), "board", held="sponge", gripper=-1.0)
    yield ScriptedMotion("withdraw", (Waypoint(up(0.10, end), 0.15),), "board")


WIPE_BOARD = Task(
    name="wipe_board",
    summary="Wipe a sponge over four stains on a board, in contact with it, and leave it at the end of the board.",
    objects=(Movable("sponge", Box(SPONGE), density=120.0, friction=0.5, color=YELLOW),),
    fixtures=(board(),),
    start={
        "sponge": Range((-0.05, -0.20), shift=(0.04, 0.08), turn=(np.deg2rad(15), np.deg2rad(30))),
        "board": Range((0.02, 0.10), shift=(0.04, 0.07), turn=(np.deg2rad(15), np.deg2rad(30))),
    },
    goals={"sponge": on_board(AFTER)},
    passes={"sponge": (on_board(BEFORE), on_board(STAINS[1]))},
    success=Success(
        {"sponge": Tolerance(xy=0.012, z=0.003)},
        also=clean,
        numbers={"stains_left": stains_left},
    ),
    demonstration="wipe_board.npz",
    script=script,
)
register_task(WIPE_BOARD)
