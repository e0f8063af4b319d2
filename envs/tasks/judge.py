"""Judge of users' own tasks, compiled: it looks at the simulator's state, never at the policy."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...planner.jit import kernel
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OBSTACLE, OTHER_ARM, WORLD


class GoalColumns(NamedTuple):
    """Columns of the rows that describe the goals to the judge, one row per goal."""

    thing: int = 0  # index of the object
    yaw_symmetry: int = 1  # see `Movable`, never None
    xy: int = 2  # tolerances, see `Tolerance`
    z: int = 3
    angle: int = 4
    width: int = 5


GOAL = GoalColumns()


class TaskVerdict(NamedTuple):
    """Verdict of the compiled judge on a state; counts and flags are whole numbers.

    Attributes:
        placed: number of objects within their tolerances and released.
        held: whether any object is touched by the fingers.
        quiet: whether all objects are at rest, and the hand has withdrawn from those with a goal.
        fallen: whether an object is off the table.
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
    """

    placed: int
    held: int
    quiet: int
    fallen: int
    unwanted: int
    low: int
    high: int


@kernel
def angle_between(pose, goal, symmetry):
    """Return the angle [rad] between two orientations, turns about the own z axis by a symmetry ignored.

    Args:
        pose: (7,) pose of an object, x y z [m] and wxyz.
        goal: (7,) its goal.
        symmetry: smallest turn after which the object looks the same [rad]; 0 for a round one.
    """
    w, z = 0.0, 0.0
    for k in range(3, 7):
        w += goal[k] * pose[k]
    z = goal[3] * pose[6] - goal[6] * pose[3] + goal[5] * pose[4] - goal[4] * pose[5]
    best = math.hypot(w, z) if symmetry == 0.0 else abs(w)
    if symmetry > 0.0:
        for k in range(1, round(2.0 * math.pi / symmetry)):
            half = 0.5 * k * symmetry
            best = max(best, abs(w * math.cos(half) + z * math.sin(half)))
    return 2.0 * math.acos(min(best, 1.0))


@kernel
def offsets(pose, goal):
    """Return the distances [m] of an object from its goal, across and along the goal's z axis.

    Args:
        pose: (7,) pose of the object, x y z [m] and wxyz.
        goal: (7,) its goal.
    """
    w, x, y, z = goal[3], goal[4], goal[5], goal[6]
    ax, ay, az = 2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)
    dx, dy, dz = pose[0] - goal[0], pose[1] - goal[1], pose[2] - goal[2]
    along = dx * ax + dy * ay + dz * az
    across = (dx - along * ax) ** 2 + (dy - along * ay) ** 2 + (dz - along * az) ** 2
    return math.sqrt(across), abs(along)


@kernel
def is_unwanted(low, high):
    """Return whether two owners should not touch: an obstacle with anything movable, or a link with anything.

    Args:
        low: smaller owner, see `WORLD` in `scene`.
        high: larger owner.
    """
    if low == OBSTACLE or high == OBSTACLE:
        return low != high and (low == OBSTACLE or low in (ARM, FINGERS, OTHER_ARM))
    if low == WORLD:
        return high in (ARM, OTHER_ARM)
    return low in (ARM, OTHER_ARM) and high >= OBSTACLE


@kernel
def judge_task(poses, velocities, tcp, touching, goals, rows, lowest, limits, errors):
    """Judge a state; return the entries of a `TaskVerdict`.

    Args:
        poses: (n, 7) poses of the objects, x y z [m] and wxyz.
        velocities: (n, 3) velocities of the objects [m/s].
        tcp: (n_arms, 7) tcp poses.
        touching: (owners, owners) contacts, see `State`.
        goals: (g, 7) goals.
        rows: (g, `GOAL.width`) description of the goals.
        lowest: z below which an object has fallen off the table [m].
        limits: (2,) largest speed of an object at rest [m/s], and least distance of the withdrawn tcp [m].
        errors: (3, g) result: distances [m] across and along the goal's z axis, and angle [rad].
    """
    placed, held, quiet, fallen = 0, 0, 1, 0
    for k in range(len(poses)):
        speed = math.sqrt(velocities[k, 0] ** 2 + velocities[k, 1] ** 2 + velocities[k, 2] ** 2)
        if speed > limits[0]:
            quiet = 0
        if touching[FINGERS, FIRST_OBJECT + k] != 0.0:
            held = 1
        if poses[k, 2] < lowest:
            fallen = 1
    for g in range(len(goals)):
        thing, pose = int(rows[g, GOAL.thing]), poses[int(rows[g, GOAL.thing])]
        across, along = offsets(pose, goals[g])
        angle = angle_between(pose, goals[g], rows[g, GOAL.yaw_symmetry])
        errors[0, g], errors[1, g], errors[2, g] = across, along, angle
        there = across <= rows[g, GOAL.xy] and along <= rows[g, GOAL.z] and angle <= rows[g, GOAL.angle]
        if there and touching[FINGERS, FIRST_OBJECT + thing] == 0.0:
            placed += 1
        away = (pose[0] - tcp[0, 0]) ** 2 + (pose[1] - tcp[0, 1]) ** 2 + (pose[2] - tcp[0, 2]) ** 2
        if math.sqrt(away) < limits[1]:
            quiet = 0
    unwanted, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            if touching[a, b] != 0.0 and is_unwanted(a, b):
                unwanted, low, high = unwanted + 1, a, b
    return placed, held, quiet, fallen, unwanted, low, high
