"""Compiled clearances of an arm, or its hand, to obstacles; independent of any planner."""

from __future__ import annotations

import numpy as np

from ...planner.collision.proximity import closest
from ...planner.geometry import screw
from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Packed
from ...planner.jit import kernel
from ...planner.robot.arm import Arm
from ...planner.robot.body import BODY, TOOL_CAPSULE, Body
from ...planner.robot.kinematics import FRAME, forward

_POINT = np.zeros((1, TOOL_CAPSULE.width))


@kernel
def _around(turn, place, x, y, z):
    moved = screw.rotate(turn, (x, y, z))
    return (place[0] + moved[0], place[1] + moved[1], place[2] + moved[2])


@kernel
def _tool_clearance(tool, x, rows, vertices):
    turn, place, clearance = (x[0], x[1], x[2], x[3]), screw.translation(x), np.inf
    for c in range(len(tool)):
        a = _around(turn, place, tool[c, TOOL_CAPSULE.a], tool[c, TOOL_CAPSULE.a + 1], tool[c, TOOL_CAPSULE.a + 2])
        b = _around(turn, place, tool[c, TOOL_CAPSULE.b], tool[c, TOOL_CAPSULE.b + 1], tool[c, TOOL_CAPSULE.b + 2])
        for k in range(len(rows)):
            clearance = min(clearance, closest(rows, k, vertices, a, b)[0] - tool[c, TOOL_CAPSULE.radius])
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
        j = int(body[c, BODY.frame])
        if j < first or j > last:
            continue
        turn, place = (1.0, 0.0, 0.0, 0.0), (0.0, 0.0, 0.0)
        if j >= 0:
            r, o = FRAME.rotation, FRAME.origin
            turn = (frames[j, r], frames[j, r + 1], frames[j, r + 2], frames[j, r + 3])
            place = (frames[j, o], frames[j, o + 1], frames[j, o + 2])
        a = _around(turn, place, body[c, BODY.a], body[c, BODY.a + 1], body[c, BODY.a + 2])
        b = _around(turn, place, body[c, BODY.b], body[c, BODY.b + 1], body[c, BODY.b + 2])
        for k in range(len(rows)):
            clearance = min(clearance, closest(rows, k, vertices, a, b)[0] - body[c, BODY.radius])
    return clearance


def tool_clearance(tool: np.ndarray, poses: np.ndarray, packed: Packed) -> float:
    """Return the smallest clearance [m] of a hand to obstacles over all given poses.

    Args:
        tool: (m, 7) capsules of the hand, see `Body.tool`.
        poses: (n, 8) tcp poses as dual quaternions.
        packed: obstacles.
    """
    return float(_sweep_clearance(tool, poses, packed.rows, packed.vertices))


def arm_clearance(arm: Arm, body: Body, q: np.ndarray, packed: Packed, joints: range | None = None) -> float:
    """Return the smallest clearance [m] of an arm to obstacles.

    Args:
        arm: kinematics of the arm.
        body: capsules of the arm.
        q: (dof,) joints [rad].
        packed: obstacles.
        joints: joints whose capsules are checked, -1 for the base; None: all.
    """
    part = joints or range(-1, arm.dof)
    work = np.empty((arm.dof, FRAME.width))
    return float(_arm_clearance(arm.chain, q, body.rows, part[0], part[-1], work, packed.rows, packed.vertices))


def point_clearance(point: np.ndarray, packed: Packed) -> float:
    """Return the distance [m] of a point to the nearest solid; infinite without solids.

    Args:
        point: (3,) point in the world [m].
        packed: solids.
    """
    return float(_tool_clearance(_POINT, tuple(Pose.from_position_quaternion(point).dq), packed.rows, packed.vertices))


def capsule_ends(arm: Arm, body: Body, q: np.ndarray, joints: range) -> np.ndarray:
    """Return the ends (m, 2, 3) [m], in the world, of an arm's capsules.

    Args:
        arm: kinematics of the arm.
        body: capsules of the arm.
        q: (dof,) joints [rad].
        joints: joints whose capsules are wanted.
    """
    frames = np.empty((arm.dof, FRAME.width))
    forward(arm.chain, q, frames)
    ends = []
    for row in body.rows[np.isin(body.rows[:, BODY.frame], list(joints))]:
        frame = frames[int(row[BODY.frame])]
        pose = Pose.from_position_quaternion(frame[FRAME.origin : FRAME.rotation], frame[FRAME.rotation :])
        ends.append([pose.position + pose.rotation @ end for end in (row[BODY.a : BODY.b], row[BODY.b : BODY.radius])])
    return np.array(ends)
