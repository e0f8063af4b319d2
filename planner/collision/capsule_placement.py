"""Compiled placement of a robot's capsules in the world, in the packed array of `robot_arrays`."""

from __future__ import annotations

import math

from ..geometry.screw import rotate
from ..geometry.shapes import OBSTACLE
from ..jit import inlined, inner, kernel
from ..robot.kinematics import FRAME, forward
from .robot_arrays import ARM_ENTRY, CAPSULE, HEADER, MASK_BITS, PLACED, ROW


@kernel
def pose_arms(g, q):
    """Compute the frames of all joints and the tcps of all arms at joints q, if they are not there yet.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
    """
    posed = True
    for i in range(len(q)):
        posed &= g[ROW.posed, i] == q[i]
        g[ROW.posed, i] = q[i]
    if posed:
        return
    for k in range(int(g[ROW.header, HEADER.arms])):
        entry = ARM_ENTRY.width * k
        first, dof = int(g[ROW.arms, entry + ARM_ENTRY.first_joint]), int(g[ROW.arms, entry + ARM_ENTRY.joints])
        chain, frames = int(g[ROW.arms, entry + ARM_ENTRY.chain]), ROW.frames + first
        x = forward(g[chain : chain + dof + 1], q[first : first + dof], g[frames : frames + dof])
        for i in range(8):
            g[ROW.tcps + k, i] = x[i]


@kernel
def place_capsules(g, q, world):
    """Place all capsules at joints q.

    Args:
        g: array of the robot, see `robot_arrays`.
        q: (n,) joints of all arms.
        world: first row of the result: ROW.placed or ROW.placed_next.
    """
    pose_arms(g, q)
    place_frames(g, world)


@kernel
def place_frames(g, world):
    """Place all capsules at the frames as they are.

    Args:
        g: array of the robot, see `robot_arrays`.
        world: first row of the result: ROW.placed or ROW.placed_next.
    """
    count = int(g[ROW.header, HEADER.capsules])
    for c in range(count):
        frame, body, row = int(g[ROW.body + c, CAPSULE.frame]), ROW.body + c, world + c
        if g[body, CAPSULE.corners] > 0.0:
            _place_hull(g, frame, row)
        if frame < 0:
            for i in range(3):
                g[row, PLACED.a + i] = g[body, CAPSULE.a + i]
                g[row, PLACED.b + i] = g[body, CAPSULE.b + i]
            continue
        f, o, r = ROW.frames + frame, FRAME.origin, FRAME.rotation
        turn = (g[f, r], g[f, r + 1], g[f, r + 2], g[f, r + 3])
        a = rotate(turn, (g[body, CAPSULE.a], g[body, CAPSULE.a + 1], g[body, CAPSULE.a + 2]))
        b = rotate(turn, (g[body, CAPSULE.b], g[body, CAPSULE.b + 1], g[body, CAPSULE.b + 2]))
        for i in range(3):
            g[row, PLACED.a + i] = a[i] + g[f, o + i]
            g[row, PLACED.b + i] = b[i] + g[f, o + i]
            g[row, PLACED.center + i] = 0.5 * (g[row, PLACED.a + i] + g[row, PLACED.b + i])
    _hold_all(g, world, count)


@inner
def _place_hull(g, frame, row):
    """Store the pose of a frame with a placed capsule: its hull is placed only where it is needed."""
    for i in range(3):
        g[row, PLACED.origin + i] = g[ROW.frames + frame, FRAME.origin + i] if frame >= 0 else 0.0
    for i in range(4):
        rest = 1.0 if i == 0 else 0.0
        g[row, PLACED.rotation + i] = g[ROW.frames + frame, FRAME.rotation + i] if frame >= 0 else rest


@inner
def _hold_all(g, world, count):
    """Compute a ball about all capsules that move, into the first row."""
    x = y = z = 0.0
    moving, k = 0, PLACED.center
    for c in range(count):
        if g[ROW.body + c, CAPSULE.frame] >= 0.0:
            x, y, z = x + g[world + c, k], y + g[world + c, k + 1], z + g[world + c, k + 2]
            moving += 1
    x, y, z = x / max(moving, 1), y / max(moving, 1), z / max(moving, 1)
    radius = 0.0
    for c in range(count):
        if g[ROW.body + c, CAPSULE.frame] >= 0.0:
            u, v, w = g[world + c, k] - x, g[world + c, k + 1] - y, g[world + c, k + 2] - z
            radius = max(radius, math.sqrt(u * u + v * v + w * w) + g[ROW.body + c, CAPSULE.ball])
    k = PLACED.all_center
    g[world, k], g[world, k + 1], g[world, k + 2], g[world, PLACED.all_radius] = x, y, z, radius


@inlined
def end_a(g, row):
    """Return the first end (3) [m] of a placed capsule.

    Args:
        g: array of the robot, see `robot_arrays`.
        row: row of the placed capsule.
    """
    return (g[row, PLACED.a], g[row, PLACED.a + 1], g[row, PLACED.a + 2])


@inlined
def end_b(g, row):
    """Return the second end (3) [m] of a placed capsule.

    Args:
        g: array of the robot, see `robot_arrays`.
        row: row of the placed capsule.
    """
    return (g[row, PLACED.b], g[row, PLACED.b + 1], g[row, PLACED.b + 2])


@inlined
def may_touch(g, obstacle, capsule):
    """Return True if a contact of the pair is allowed, so that the pair is not checked.

    Args:
        g: array of the robot, see `robot_arrays`.
        obstacle: number of the obstacle.
        capsule: number of the capsule.
    """
    return (int(g[ROW.obstacles + obstacle, OBSTACLE.mask + capsule // MASK_BITS]) >> (capsule % MASK_BITS)) & 1 == 1
