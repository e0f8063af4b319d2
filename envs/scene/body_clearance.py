"""How much room an arm, or its hand, has beside obstacles, compiled; knows no planner."""

from __future__ import annotations

import numpy as np

from ...planner.collision.proximity import closest
from ...planner.geometry import screw
from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Packed
from ...planner.jit import kernel
from ...planner.robot.arm import Arm
from ...planner.robot.body import Body
from ...planner.robot.kinematics import FRAME, forward

_POINT = np.zeros((1, 7))


@kernel
def _around(turn, place, x, y, z):
    moved = screw.rotate(turn, (x, y, z))
    return (place[0] + moved[0], place[1] + moved[1], place[2] + moved[2])


@kernel
def _tool_clearance(tool, x, rows, vertices):
    turn, place, clearance = (x[0], x[1], x[2], x[3]), screw.translation(x), np.inf
    for c in range(len(tool)):
        a = _around(turn, place, tool[c, 0], tool[c, 1], tool[c, 2])
        b = _around(turn, place, tool[c, 3], tool[c, 4], tool[c, 5])
        for k in range(len(rows)):
            clearance = min(clearance, closest(rows, k, vertices, a, b)[0] - tool[c, 6])
    return clearance


@kernel
def _sweep_clearance(tool, poses, rows, vertices):
    clearance = np.inf
    for i in range(len(poses)):
        clearance = min(clearance, _tool_clearance(tool, screw.load8(poses, i), rows, vertices))
    return clearance


@kernel
def _arm_clearance(chain, q, body, first, last, frames, rows, vertices):
    forward(chain, q, frames)
    clearance = np.inf
    for c in range(len(body)):
        j = int(body[c, 0])
        if j < first or j > last:
            continue
        turn, place = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if j >= 0:
            turn = (frames[j, 6], frames[j, 7], frames[j, 8], frames[j, 9])
            place = (frames[j, 3], frames[j, 4], frames[j, 5])
        a = _around(turn, place, body[c, 1], body[c, 2], body[c, 3])
        b = _around(turn, place, body[c, 4], body[c, 5], body[c, 6])
        for k in range(len(rows)):
            clearance = min(clearance, closest(rows, k, vertices, a, b)[0] - body[c, 7])
    return clearance


def tool_clearance(tool: np.ndarray, poses: np.ndarray, packed: Packed) -> float:
    """Smallest room [m] of capsules of a hand, see `Body.tool`, at any of the poses (n, 8)."""
    return float(_sweep_clearance(tool, poses, packed.rows, packed.vertices))


def arm_clearance(arm: Arm, body: Body, q: np.ndarray, packed: Packed, joints: range | None = None) -> float:
    """Smallest room [m] of an arm at joints q (dof,), or of what moves with some joints alone; -1 is its base."""
    part = joints or range(-1, arm.dof)
    work = np.empty((arm.dof, FRAME))
    return float(_arm_clearance(arm.chain, q, body.rows, part[0], part[-1], work, packed.rows, packed.vertices))


def point_clearance(point: np.ndarray, packed: Packed) -> float:
    """Smallest distance [m] of a point (3,) to some solids; infinite without any."""
    return float(_tool_clearance(_POINT, tuple(Pose.from_position_quaternion(point).dq), packed.rows, packed.vertices))


def capsule_ends(arm: Arm, body: Body, q: np.ndarray, joints: range) -> np.ndarray:
    """(m, 2, 3) ends [m] in the world of the capsules that move with some joints."""
    frames = np.empty((arm.dof, FRAME))
    forward(arm.chain, q, frames)
    ends = []
    for row in body.rows[np.isin(body.rows[:, 0], list(joints))]:
        frame = frames[int(row[0])]
        pose = Pose.from_position_quaternion(frame[3:6], frame[6:10])
        ends.append([pose.position + pose.rotation @ end for end in (row[1:4], row[4:7])])
    return np.array(ends)
