"""Compiled flood of postures along a guided path: from its end backwards, which postures lead to the end.

The nodes are joints whose pose of the tool lies on the path, or off it within bounds; the search is over place along
the path, deviation from it and redundancy. An edge leads to the next place: the tool moves on the screw between both
poses in small steps, each reached by inverse kinematics from the one before, and each line between them is proven
clear. Not in the paper.
"""

from __future__ import annotations

import math
from typing import NamedTuple

from ..collision.joint_lines import joint_edge_is_clear
from ..collision.robot_arrays import MAX_JOINTS, ROW
from ..control.arm_arrays import ARM, pose_and_jacobian
from ..control.controller import joint_velocity
from ..escape.tangent_plane import random_number
from ..geometry import screw
from ..jit import inner, kernel

DISTANCE, ANGLE = 5e-5, 2e-4
"""Errors [m], [rad] at which joints reach a pose."""
SOLVE = 20
"""Largest number of steps of inverse kinematics from a near posture."""
PART = 0.08
"""Largest change of a joint [rad or m] between two of an edge's steps."""
PARTS = 32
"""Largest number of steps of an edge."""
JUMP = 3.0
"""Factor of an even share by which a step of an edge may be longer: beyond, the arm flips to another posture."""
APART = 0.05
"""Distance [rad or m] of every joint below which two postures of a place count as one."""


class FloodColumns(NamedTuple):
    """Columns of the options of a flood."""

    position: int = 0  # largest deviation from the path [m]
    rotation: int = 1  # [rad]
    push: int = 2  # standard size [rad or m] of a push along the redundancy
    branches: int = 3  # number of postures tried from each
    width: int = 4


FLOOD = FloodColumns()


@inner
def _solved(work, target, q, qdot):
    """Move joints q to a pose near by; False if it is not reached."""
    for _ in range(SOLVE):
        x = pose_and_jacobian(work, q)
        distance, angle = screw.pose_distance(x, target)
        if distance < DISTANCE and angle < ANGLE:
            return True
        joint_velocity(work, q, screw.shorter(screw.mul(screw.conj(x), target)), qdot)
        for i in range(len(q)):
            q[i] += qdot[i]
    return False


@kernel
def edge_along(g, work, start, end, rows, scratch):
    """Write joints on the way between two postures whose tool moves along the screw between their poses.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        work: array of the arm, see `arm_arrays`, for inverse kinematics.
        start: (n,) joints; not written.
        end: (n,) joints, the last of what is written.
        rows: (PARTS, n) joints, the result.
        scratch: (n,).

    Returns:
        The number of rows; 0 if there is no such way, or it is not proven clear.
    """
    n, longest = len(start), 0.0
    for i in range(n):
        longest = max(longest, abs(end[i] - start[i]))
    parts = max(1, math.ceil(longest / PART))
    if parts > len(rows):
        return 0
    x, y = pose_and_jacobian(work, start), pose_and_jacobian(work, end)
    for k in range(parts):
        s = (k + 1) / parts
        for i in range(n):
            rows[k, i] = end[i] if k == parts - 1 else start[i] + s * (end[i] - start[i])
        if k < parts - 1 and not _solved(work, screw.sclerp(x, y, s), rows[k], scratch):
            return 0
        for i in range(n):
            before = start[i] if k == 0 else rows[k - 1, i]
            if abs(rows[k, i] - before) > JUMP * PART:
                return 0
        if not joint_edge_is_clear(g, start if k == 0 else rows[k - 1], rows[k]):
            return 0
    return parts


@inner
def _known(nodes, count, q):
    """True if a posture is one of those of a place."""
    for k in range(count):
        apart = 0.0
        for i in range(len(q)):
            apart = max(apart, abs(nodes[k, i] - q[i]))
        if apart < APART:
            return True
    return False


@inner
def _normal(state):
    """Number with a mean of 0 and a deviation of 1: a sum of twelve even ones, without a logarithm."""
    total = -6.0
    for _ in range(12):
        total += random_number(state)
    return total


@inner
def _in_ball(radius, state):
    """Random vector in a ball; what is outside, in the cube around it, is moved onto it, where most room is used."""
    a, b, c = 2.0 * random_number(state) - 1.0, 2.0 * random_number(state) - 1.0, 2.0 * random_number(state) - 1.0
    scale = radius / max(1.0, math.sqrt(a * a + b * b + c * c))
    return (scale * a, scale * b, scale * c)


@inner
def off_path(x, position, rotation, state):
    """Pose off a pose by a random part of the bounds.

    Args:
        x: pose, a tuple of 8, whose origin counts.
        position: bound [m].
        rotation: bound [rad].
        state: (1,) of the random numbers.
    """
    turn, shift = _in_ball(rotation, state), _in_ball(position, state)
    y = screw.mul(x, screw.from_twist((0.0, 0.0, 0.0, turn[0], turn[1], turn[2])))
    p = screw.translation(x)
    return screw.from_pose((p[0] + shift[0], p[1] + shift[1], p[2] + shift[2]), (y[0], y[1], y[2], y[3]))


@kernel
def spread_back(g, work, path, place, before, nodes, links, counts, first, last, options, state, rows):
    """Lead postures of a place one place back along the path, each in several ways.

    Args:
        g: the robot among obstacles, see `robot_arrays`.
        work: array of the arm, see `arm_arrays`, for inverse kinematics.
        path: (m, 8) poses of the places.
        place: of the postures that are led back.
        before: the place that they are led to.
        nodes: (m, c, n) joints of the postures of each place.
        links: (m, c) numbers of the postures that they lead to, at the place behind; -1 at the end.
        counts: (m,) numbers of postures.
        first: first posture that is led back.
        last: number behind the last one.
        options: see FLOOD.
        state: (1,) of the random numbers.
        rows: (PARTS, n) scratch.
    """
    n = nodes.shape[2]
    q, qdot = g[ROW.part, MAX_JOINTS : MAX_JOINTS + n], g[ROW.after, MAX_JOINTS : MAX_JOINTS + n]
    for k in range(first, last):
        for branch in range(int(options[FLOOD.branches])):
            count = int(counts[before])
            if count >= nodes.shape[1]:
                return
            target = screw.load8(path, before)
            if branch % 2 == 1:
                target = off_path(target, options[FLOOD.position], options[FLOOD.rotation], state)
            push = options[FLOOD.push] if branch > 1 else 0.0
            for i in range(n):
                q[i] = nodes[place, k, i] + (push * _normal(state) if push > 0.0 else 0.0)
                q[i] = min(max(q[i], work[ARM.lower, i]), work[ARM.upper, i])
            if not _solved(work, target, q, qdot) or _known(nodes[before], count, q):
                continue
            for i in range(n):
                nodes[before, count, i] = q[i]
            if edge_along(g, work, nodes[before, count], nodes[place, k], rows, qdot) == 0:
                continue
            links[before, count] = k
            counts[before] = count + 1
