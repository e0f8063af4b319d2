"""Judge of all tasks in which objects have goals, compiled: it looks at the simulator's state, never at the policy."""

from __future__ import annotations

import math
from typing import NamedTuple

from ...planner.jit import kernel
from ..scene.scene import FINGERS, FIRST_OBJECT


class Measures(NamedTuple):
    """Rows of the errors of objects at their goals."""

    horizontal: int = 0  # horizontal distance [m]
    height: int = 1  # difference in height [m]
    yaw: int = 2  # difference in yaw, half turns ignored [rad]
    across: int = 3  # distance across the goal's z axis [m]
    along: int = 4  # distance along it [m]
    distance: int = 5  # distance [m]
    angle: int = 6  # angle, turns after which the object looks the same ignored [rad]
    width: int = 7


class GoalColumns(NamedTuple):
    """Columns of the rows that describe the goals to the judge, one row per goal."""

    thing: int = 0  # index of the object
    yaw_symmetry: int = 1  # smallest turn after which it looks the same [rad]
    lost: int = 2  # error from which one that was lifted and rests was dropped
    lost_by: int = 3  # measure of this error
    tolerances: int = 4  # largest errors, in the order of the measures
    width: int = 11


class LimitPlaces(NamedTuple):
    """Places of the limits of a task."""

    still: int = 0  # largest speed of an object at rest [m/s]
    withdrawn: int = 1  # least distance of the withdrawn tcp from objects with goals [m]
    lowest: int = 2  # z below which an object has fallen off the table [m]
    lifted: int = 3  # height above its start from which an object is lifted [m]
    ordered: int = 4  # 1 if the goals must be met in their order
    in_turn: int = 5  # 1 if the fingers may only touch the object whose turn it is, and the one before it
    width: int = 6


class MemoryRows(NamedTuple):
    """Rows of the numbers that the judge keeps about each object."""

    height: int = 0  # where it was last put: z [m]
    was_lifted: int = 1  # 1 once it was lifted
    width: int = 2


MEASURE, GOAL, LIMIT, MEMORY = Measures(), GoalColumns(), LimitPlaces(), MemoryRows()


class GoalVerdict(NamedTuple):
    """Verdict of the compiled judge on a state; counts and flags are whole numbers.

    Attributes:
        placed: number of objects at their goals and released; where an order counts, from the first on.
        held: whether the next object, or where no order counts any object, is touched by the fingers.
        raised: whether this next object is lifted as well.
        quiet: whether all objects are at rest, and the hand has withdrawn from those with a goal.
        lost: whether an object was lifted and now rests elsewhere.
        fallen: whether an object is off the table.
        disturbed: whether an object that must stay was moved.
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
    """

    placed: int
    held: int
    raised: int
    quiet: int
    lost: int
    fallen: int
    disturbed: int
    unwanted: int
    low: int
    high: int


@kernel
def distance(a, b):
    """Return the distance [m] of two points or poses.

    Args:
        a: (3,) point, or (7,) pose of which only the position counts.
        b: (3,) point or (7,) pose, likewise.
    """
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def yaw_error(pose, goal):
    """Return the yaw between two poses [rad], half turns ignored, in [0, pi / 2].

    Args:
        pose: (7,) pose of an object, x y z [m] and wxyz.
        goal: (7,) its goal.
    """
    turn = 2.0 * (math.atan2(pose[6], pose[3]) - math.atan2(goal[6], goal[3])) % math.pi
    return min(turn, math.pi - turn)


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
def measure(pose, goal, symmetry, errors):
    """Measure the errors of an object at its goal.

    Args:
        pose: (7,) pose of the object, x y z [m] and wxyz.
        goal: (7,) its goal.
        symmetry: smallest turn after which the object looks the same [rad]; 0 for a round one.
        errors: (`MEASURE.width`,) result.
    """
    errors[MEASURE.horizontal] = math.hypot(pose[0] - goal[0], pose[1] - goal[1])
    errors[MEASURE.height] = abs(pose[2] - goal[2])
    errors[MEASURE.yaw] = yaw_error(pose, goal)
    errors[MEASURE.across], errors[MEASURE.along] = offsets(pose, goal)
    errors[MEASURE.distance] = distance(pose, goal)
    errors[MEASURE.angle] = angle_between(pose, goal, symmetry)


@kernel
def is_met(errors, row):
    """Return whether all errors (`MEASURE.width`,) of a goal are within the tolerances in its row.

    Args:
        errors: see `measure`.
        row: (`GOAL.width`,) description of the goal.
    """
    met = True
    for k in range(MEASURE.width):
        met = met and errors[k] <= row[GOAL.tolerances + k]
    return met


@kernel
def unwanted_contacts(touching, allowed, following):
    """Return the number of pairs in unwanted contact, and the owners in the last one, smaller first, or -1.

    Args:
        touching: (owners, owners) contacts, see `State`.
        allowed: (owners, owners) 1 where two owners may touch, the smaller first.
        following: index of the only object, besides the one before it, that the fingers may touch; -1: any allowed one.
    """
    count, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            early = a == FINGERS and b >= FIRST_OBJECT and following >= 0
            early = early and b - FIRST_OBJECT != following and b - FIRST_OBJECT != following - 1
            if touching[a, b] != 0.0 and (allowed[a, b] == 0.0 or early):
                count, low, high = count + 1, a, b
    return count, low, high


@kernel
def _is_still(velocity, limits):
    speed = math.sqrt(velocity[0] ** 2 + velocity[1] ** 2 + velocity[2] ** 2)
    return speed <= limits[LIMIT.still]


@kernel
def _objects(poses, velocities, start, stays, limits):
    """Return whether all objects are at rest, one is off the table, and one that must stay was moved."""
    quiet, fallen, disturbed = True, False, False
    for k in range(len(poses)):
        quiet = quiet and _is_still(velocities[k], limits)
        fallen |= poses[k, 2] < limits[LIMIT.lowest]
        disturbed |= distance(poses[k], start[k]) > stays[k, 0]
        disturbed |= angle_between(poses[k], start[k], 2.0 * math.pi) > stays[k, 1]
    return quiet, fallen, disturbed


@kernel
def _goals(poses, velocities, tcp, touching, goals, rows, limits, memory, errors):
    """Return the number of objects in place; whether the next is held, is raised, the hand is away, and one is lost."""
    placed, counting, away, lost, held, raised = 0, True, True, False, False, False
    for g in range(len(goals)):
        k = int(rows[g, GOAL.thing])
        pose, in_hand = poses[k], touching[FINGERS, FIRST_OBJECT + k] != 0.0
        measure(pose, goals[g], rows[g, GOAL.yaw_symmetry], errors[g])
        in_place = is_met(errors[g], rows[g]) and not in_hand
        counting = counting and (in_place or limits[LIMIT.ordered] == 0.0)
        placed += counting and in_place
        away = away and distance(pose, tcp[0]) >= limits[LIMIT.withdrawn]
        if in_hand and pose[2] > memory[MEMORY.height, k] + limits[LIMIT.lifted]:
            memory[MEMORY.was_lifted, k] = 1.0
        still = _is_still(velocities[k], limits)
        lost |= (
            memory[MEMORY.was_lifted, k] != 0.0
            and still
            and not in_hand
            and errors[g, int(rows[g, GOAL.lost_by])] > rows[g, GOAL.lost]
        )
    for k in range(len(poses)):
        following = placed < len(goals) and k == int(rows[placed, GOAL.thing])
        if touching[FINGERS, FIRST_OBJECT + k] != 0.0 and (following or limits[LIMIT.ordered] == 0.0):
            held = True
            raised |= poses[k, 2] > memory[MEMORY.height, k] + limits[LIMIT.lifted]
    return placed, int(held), int(raised), away, int(lost)


@kernel
def judge_state(poses, velocities, tcp, touching, goals, start, rows, stays, limits, allowed, memory, errors):
    """Judge a state; return the entries of a `GoalVerdict`.

    Args:
        poses: (n, 7) poses of the objects, x y z [m] and wxyz.
        velocities: (n, 3) velocities of the objects [m/s].
        tcp: (n_arms, 7) tcp poses.
        touching: (owners, owners) contacts, see `State`.
        goals: (g, 7) goals.
        start: (n, 7) poses of the objects at the start.
        rows: (g, `GOAL.width`) description of the goals.
        stays: (n, 2) how far [m, rad] an object may be moved; infinite: anywhere.
        limits: see `LIMIT`.
        allowed: (owners, owners) 1 where two owners may touch, the smaller first.
        memory: (`MEMORY.width`, n) see `MEMORY`; updated.
        errors: (g, `MEASURE.width`) result.
    """
    quiet, fallen, disturbed = _objects(poses, velocities, start, stays, limits)
    placed, held, raised, away, lost = _goals(poses, velocities, tcp, touching, goals, rows, limits, memory, errors)
    following = placed if limits[LIMIT.in_turn] != 0.0 else -1
    unwanted, low, high = unwanted_contacts(touching, allowed, following)
    return placed, held, raised, int(quiet and away), lost, int(fallen), int(disturbed), unwanted, low, high


@kernel
def shaped(poses, goals, tcp, placed, held):
    """Return the dense reward in [0, 1]: share of objects placed, and of the current one reached, grasped and carried.

    Args:
        poses: (n, 7) poses of the objects, those with goals first, x y z [m] and wxyz.
        goals: (g, 7) goals.
        tcp: (n_arms, 7) tcp poses.
        placed: number of objects in place.
        held: whether the next one is in the hand.
    """
    n = len(goals)
    if placed == n:
        return 1.0
    reach = 1.0 - math.tanh(5.0 * distance(poses[placed], tcp[0]))
    carry = 1.0 - math.tanh(5.0 * distance(poses[placed], goals[placed]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if held else 0.0)
    return (placed + part) / n
