"""One array that holds a robot with its body and the obstacles around it: what clearance and safety work on.

A robot is one arm or several: joints are counted through, arm by arm. As in `workspace`, one array keeps calls from
Python cheap and nothing is allocated in a loop. One per thread.

| rows | hold |
|---|---|
| HEADER | arms, joints, capsules, obstacles, pairs, near pairs, and the first rows of what has no fixed place |
| SETTINGS | of the safety layer, see `safety` |
| ARMS | per arm: first joint, joints, first row of its chain |
| LOW, HIGH, SPEED, SLIDING | joint limits, largest speeds, 1 for a sliding joint |
| STEP to ACTIVE | scratch of the width of the joints |
| PREVIOUS, DESIRED | the speeds that were commanded last, that are wanted now |
| LEVERS | per joint: no point that it moves is ever farther from its axis [m] |
| SEEN | joints at the last look at everything, then the smallest room then, 1 if it counts, 1 if obstacles move |
| POSED | joints that the frames belong to |
| TCPS | per arm: pose of its tcp |
| CHAINS, FRAMES | see `chain`; the frame of joint j is row FRAMES + j |
| BODY | per capsule: arm, joint whose frame it moves with (-1: none), ends in that frame, radius, ball that holds it |
| WORLD, NEXT | per capsule: ends and center in the world, motion bound of a step; then a ball about all that move |
| obstacles | see `shapes`; then a mask of capsules that may touch, safety distance |
| pairs | capsules of the robot that may hit each other |
| near | pairs that are close now, see `clearance` |
| bounds | rows of the quadratic program |
| vertices | of the meshes |
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..errors import BadOption
from ..geometry.screw import rotate
from ..geometry.shapes import ROW, Packed
from ..jit import inlined, inner, kernel
from ..robot.arm import Arm
from ..robot.body import Body
from ..robot.kinematics import forward

WIDTH = 40
MAX_ARMS, MAX_JOINTS, MAX_CAPSULES = 2, 16, 52
HEADER, SETTINGS, ARMS, LOW, HIGH, SPEED = 0, 1, 2, 3, 4, 5
STEP, WISH, PART, AFTER, BEFORE, ACTIVE, PREVIOUS = 6, 7, 8, 9, 10, 11, 12
SLIDING, TCPS, WEIGHT, CHAINS, DESIRED, LEVERS, SEEN, POSED = 13, 14, 16, 32, 60, 61, 62, 63
FRAMES, BODY, WORLD, NEXT, FACTOR, OBSTACLES = 64, 84, 136, 188, 240, 272
# columns of the header
N_ARMS, N_JOINTS, N_CAPSULES, N_OBSTACLES, N_PAIRS, N_NEAR, PAIRS, NEAR, BOUNDS, VERTICES = range(10)
# columns of a body row, and of a world row
B_ARM, B_FRAME, B_A, B_B, B_RADIUS, B_BALL = 0, 1, 2, 5, 8, 9
W_A, W_B, W_CENTER, W_REACH, W_ALL = 0, 3, 6, 9, 10
# columns of SEEN
SEEN_ROOM, SEEN_COUNTS, SEEN_MOVING = 16, 17, 18
# further columns of an obstacle
MASK, MARGIN = ROW, ROW + 1


def robot_arrays(
    arms: Sequence[Arm],
    bodies: Sequence[Body],
    packed: Packed,
    *,
    masks: Sequence[int] = (),
    margin: float = 0.0,
    pairs: Sequence[tuple[int, int]] = (),
    settings: Sequence[float] = (),
) -> np.ndarray:
    """The array of a robot among obstacles.

    Args:
        arms: the arms.
        bodies: their bodies, in the same order.
        packed: the obstacles.
        masks: per obstacle the capsules, counted through all bodies, that may touch it, as bits of a number.
        margin: safety distance [m] to keep from obstacles without one of their own.
        pairs: capsules that may hit each other, counted through all bodies.
        settings: numbers of the row SETTINGS.
    """
    count, joints = sum(len(body) for body in bodies), sum(arm.dof for arm in arms)
    if len(arms) > MAX_ARMS or count > MAX_CAPSULES or joints > MAX_JOINTS:
        reason = (
            f"{len(arms)} arms, {count} capsules and {joints} joints; "
            f"allowed are {MAX_ARMS}, {MAX_CAPSULES} and {MAX_JOINTS}"
        )
        raise BadOption("robot", reason)
    work = np.zeros((OBSTACLES + len(pairs), WIDTH))
    work[HEADER, :5] = len(arms), joints, count, 0, len(pairs)
    work[HEADER, PAIRS] = OBSTACLES
    work[SETTINGS, : len(settings)] = settings
    work[POSED] = np.nan
    if len(pairs):
        work[OBSTACLES:, :2] = pairs
    _lay_arms(work, arms, bodies)
    return with_obstacles(work, packed, masks, margin)


def with_obstacles(robot: np.ndarray, packed: Packed, masks: Sequence[int], margin: float) -> np.ndarray:
    """The array of a robot, moved among other obstacles; see `robot_arrays`."""
    joints, capsules, pairs = (int(robot[HEADER, column]) for column in (N_JOINTS, N_CAPSULES, N_PAIRS))
    k, old = len(packed.rows), int(robot[HEADER, PAIRS])
    near = capsules * k + pairs
    first_pair = OBSTACLES + k
    first_near = first_pair + pairs
    first_bound = first_near + near
    first_vertex = first_bound + near + 2 * joints
    work = np.zeros((first_vertex + len(packed.vertices), WIDTH))
    work[:OBSTACLES] = robot[:OBSTACLES]
    work[HEADER, N_OBSTACLES : N_NEAR + 1] = k, pairs, 0
    work[HEADER, PAIRS : VERTICES + 1] = first_pair, first_near, first_bound, first_vertex
    work[SEEN, SEEN_COUNTS], work[SEEN, SEEN_MOVING] = 0.0, float(packed.rows[:, 17:20].any())
    rows = work[OBSTACLES:first_pair]
    rows[:, :ROW] = packed.rows
    # vertices lie in the same array: meshes know their rows in it
    rows[:, 21] += first_vertex
    rows[:, MASK] = masks if len(masks) else 0
    rows[:, MARGIN] = np.where(packed.rows[:, 23] < 0, margin, packed.rows[:, 23])
    work[first_pair:first_near] = robot[old : old + pairs]
    work[first_vertex:, :3] = packed.vertices
    return work


def _lay_arms(work: np.ndarray, arms: Sequence[Arm], bodies: Sequence[Body]) -> None:
    joint, chain, capsule = 0, CHAINS, BODY
    for k, (arm, body) in enumerate(zip(arms, bodies, strict=True)):
        work[ARMS, 3 * k : 3 * k + 3] = joint, arm.dof, chain
        columns = slice(joint, joint + arm.dof)
        work[LOW, columns], work[HIGH, columns], work[SPEED, columns] = arm.lower, arm.upper, arm.velocity_limits
        work[chain : chain + arm.dof + 1, :8] = arm.chain
        work[SLIDING, columns] = arm.chain[:-1, 7]
        rows = work[capsule : capsule + len(body)]
        rows[:, B_ARM] = k
        rows[:, B_FRAME] = np.where(body.rows[:, 0] < 0, -1, body.rows[:, 0] + joint)
        lay_capsules(rows, body.rows[:, 1:8])
        # from joint to joint, then to the farthest point of a capsule; a slide may be anywhere in its range
        offsets = np.linalg.norm(arm.chain[:, 4:7], axis=1)
        offsets[:-1] += np.where(arm.chain[:-1, 7] == 1.0, np.maximum(abs(arm.lower), abs(arm.upper)), 0.0)
        extents = np.linalg.norm(body.rows[:, 1:7].reshape(-1, 2, 3), axis=2).max(axis=1) if len(body) else np.zeros(1)
        beyond = np.append(np.cumsum(offsets[:0:-1])[::-1], 0.0)[: arm.dof]
        levers = np.where(np.isfinite(beyond), beyond, 1e6) + extents.max()
        work[LEVERS, columns] = np.where(arm.chain[:-1, 7] == 1.0, 1.0, levers)
        joint, chain, capsule = joint + arm.dof, chain + arm.dof + 1, capsule + len(body)


def lay_capsules(rows: np.ndarray, capsules: np.ndarray) -> None:
    """Write capsules (m, 7), ends and radius, into body rows."""
    rows[:, B_A : B_RADIUS + 1] = capsules
    rows[:, B_BALL] = 0.5 * np.linalg.norm(capsules[:, 3:6] - capsules[:, :3], axis=1) + capsules[:, 6]


@kernel
def pose_arms(g, q):
    """Forward kinematics of all arms at q (joints,): their frames into the rows FRAMES, if they are not there yet."""
    posed = True
    for i in range(len(q)):
        posed &= g[POSED, i] == q[i]
        g[POSED, i] = q[i]
    if posed:
        return
    for k in range(int(g[HEADER, N_ARMS])):
        first, dof, chain = int(g[ARMS, 3 * k]), int(g[ARMS, 3 * k + 1]), int(g[ARMS, 3 * k + 2])
        x = forward(g[chain : chain + dof + 1], q[first : first + dof], g[FRAMES + first : FRAMES + first + dof])
        for i in range(8):
            g[TCPS + k, i] = x[i]


@kernel
def place_capsules(g, q, world):
    """Capsules at q into the rows from `world` on (WORLD or NEXT)."""
    pose_arms(g, q)
    place_frames(g, world)


@kernel
def place_frames(g, world):
    """Capsules at the frames as they are into the rows from `world` on."""
    count = int(g[HEADER, N_CAPSULES])
    for c in range(count):
        frame, body, row = int(g[BODY + c, B_FRAME]), BODY + c, world + c
        if frame < 0:
            for i in range(6):
                g[row, i] = g[body, B_A + i]
            continue
        f = FRAMES + frame
        r = (g[f, 6], g[f, 7], g[f, 8], g[f, 9])
        a = rotate(r, (g[body, 2], g[body, 3], g[body, 4]))
        b = rotate(r, (g[body, 5], g[body, 6], g[body, 7]))
        for i in range(3):
            g[row, W_A + i] = a[i] + g[f, 3 + i]
            g[row, W_B + i] = b[i] + g[f, 3 + i]
            g[row, W_CENTER + i] = 0.5 * (g[row, W_A + i] + g[row, W_B + i])
    _hold_all(g, world, count)


@inner
def _hold_all(g, world, count):
    """A ball about all capsules that move, into columns 10 to 13 of the first row: center and radius."""
    x = y = z = 0.0
    moving = 0
    for c in range(count):
        if g[BODY + c, B_FRAME] >= 0.0:
            x, y, z = x + g[world + c, W_CENTER], y + g[world + c, 7], z + g[world + c, 8]
            moving += 1
    x, y, z = x / max(moving, 1), y / max(moving, 1), z / max(moving, 1)
    radius = 0.0
    for c in range(count):
        if g[BODY + c, B_FRAME] >= 0.0:
            u, v, w = g[world + c, W_CENTER] - x, g[world + c, 7] - y, g[world + c, 8] - z
            radius = max(radius, math.sqrt(u * u + v * v + w * w) + g[BODY + c, B_BALL])
    g[world, W_ALL], g[world, 11], g[world, 12], g[world, 13] = x, y, z, radius


@inlined
def end_a(g, row):
    """First end of a capsule in the world."""
    return (g[row, 0], g[row, 1], g[row, 2])


@inlined
def end_b(g, row):
    """Second end of a capsule in the world."""
    return (g[row, 3], g[row, 4], g[row, 5])


@inlined
def may_touch(g, obstacle, capsule):
    """True if a wanted contact: the pair is not looked at."""
    return (int(g[OBSTACLES + obstacle, MASK]) >> capsule) & 1 == 1
