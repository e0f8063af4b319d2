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
| PREVIOUS | the speeds that were commanded last |
| TCPS | per arm: pose of its tcp |
| CHAINS, FRAMES | see `chain`; the frame of joint j is row FRAMES + j |
| BODY | per capsule: arm, joint whose frame it moves with (-1: none), ends in that frame, radius |
| WORLD, NEXT | per capsule: ends in the world, half length, motion bound of a step |
| obstacles | see `shapes`; then a mask of capsules that may touch, safety distance |
| pairs | capsules of the robot that may hit each other |
| near | pairs that are close now, see `clearance` |
| bounds | rows of the quadratic program |
| vertices | of the meshes |
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from .arm import Arm
from .body import Body
from .chain import forward
from .errors import BadOption
from .jit import kernel
from .screw import rotate
from .shapes import ROW, Packed

WIDTH = 40
MAX_ARMS, MAX_JOINTS, MAX_CAPSULES = 2, 16, 52
HEADER, SETTINGS, ARMS, LOW, HIGH, SPEED = 0, 1, 2, 3, 4, 5
STEP, WISH, PART, AFTER, BEFORE, ACTIVE, PREVIOUS = 6, 7, 8, 9, 10, 11, 12
SLIDING, TCPS, WEIGHT, CHAINS = 13, 14, 16, 32
FRAMES, BODY, WORLD, NEXT, FACTOR, OBSTACLES = 64, 84, 136, 188, 240, 272
# columns of the header
N_ARMS, N_JOINTS, N_CAPSULES, N_OBSTACLES, N_PAIRS, N_NEAR, PAIRS, NEAR, BOUNDS, VERTICES = range(10)
# columns of a body row, and of a world row
B_ARM, B_FRAME, B_A, B_B, B_RADIUS = 0, 1, 2, 5, 8
W_A, W_B, W_HALF, W_REACH = 0, 3, 6, 7
# further columns of an obstacle
MASK, MARGIN = ROW, ROW + 1


def robot_work(
    arms: Sequence[Arm],
    bodies: Sequence[Body],
    packed: Packed,
    *,
    masks: Sequence[int] = (),
    margin: float = 0.0,
    pairs: Sequence[tuple[int, int]] = (),
    settings: Sequence[float] = (),
    most_near: int = 0,
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
        most_near: capacity for near pairs; 0: as many as there can be.
    """
    count, joints = sum(len(body) for body in bodies), sum(arm.dof for arm in arms)
    if len(arms) > MAX_ARMS or count > MAX_CAPSULES or joints > MAX_JOINTS:
        reason = (
            f"{len(arms)} arms, {count} capsules and {joints} joints; "
            f"allowed are {MAX_ARMS}, {MAX_CAPSULES} and {MAX_JOINTS}"
        )
        raise BadOption("robot", reason)
    k, p = len(packed.rows), len(pairs)
    near = most_near or count * k + p
    first_pair = OBSTACLES + k
    first_near = first_pair + p
    first_bound = first_near + near
    first_vertex = first_bound + near + 2 * joints
    work = np.zeros((first_vertex + len(packed.vertices), WIDTH))
    work[HEADER, :10] = len(arms), joints, count, k, p, 0, first_pair, first_near, first_bound, first_vertex
    work[SETTINGS, : len(settings)] = settings
    _lay_arms(work, arms, bodies)
    work[OBSTACLES:first_pair, :ROW] = packed.rows
    work[OBSTACLES:first_pair, MASK] = masks if len(masks) else 0
    work[OBSTACLES:first_pair, MARGIN] = np.where(packed.rows[:, 23] < 0, margin, packed.rows[:, 23])
    if p:
        work[first_pair:first_near, :2] = pairs
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
        rows[:, B_A : B_RADIUS + 1] = body.rows[:, 1:8]
        joint, chain, capsule = joint + arm.dof, chain + arm.dof + 1, capsule + len(body)


@kernel
def pose_arms(g, q):
    """Forward kinematics of all arms at q (joints,): their frames into the rows FRAMES."""
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
    for c in range(int(g[HEADER, N_CAPSULES])):
        frame = int(g[BODY + c, B_FRAME])
        if frame < 0:
            for i in range(6):
                g[world + c, i] = g[BODY + c, B_A + i]
            continue
        f = FRAMES + frame
        r = (g[f, 6], g[f, 7], g[f, 8], g[f, 9])
        a = rotate(r, (g[BODY + c, 2], g[BODY + c, 3], g[BODY + c, 4]))
        b = rotate(r, (g[BODY + c, 5], g[BODY + c, 6], g[BODY + c, 7]))
        for i in range(3):
            g[world + c, W_A + i] = a[i] + g[f, 3 + i]
            g[world + c, W_B + i] = b[i] + g[f, 3 + i]


@kernel
def end_a(g, row):
    """First end of a capsule in the world."""
    return (g[row, 0], g[row, 1], g[row, 2])


@kernel
def end_b(g, row):
    """Second end of a capsule in the world."""
    return (g[row, 3], g[row, 4], g[row, 5])


@kernel
def may_touch(g, obstacle, capsule):
    """True if a wanted contact: the pair is not looked at."""
    return (int(g[OBSTACLES + obstacle, MASK]) >> capsule) & 1 == 1
