"""The packed array of a robot with its body and the obstacles around it, which clearance and safety work on.

A robot is one arm or several; joints and capsules are counted through, arm by arm. As in `arm_arrays`, one array
keeps calls from Python cheap, and no kernel allocates. Use one array per thread.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from ..errors import BadModel, BadOption
from ..geometry.convex_distance import PER_ROW
from ..geometry.shapes import OBSTACLE, Packed
from ..robot.arm import Arm
from ..robot.body import BODY, MAX_CAPSULES, TOOL_CAPSULE, Body, Hull
from ..robot.kinematics import CHAIN, PRISMATIC

WIDTH = 40
MAX_ARMS, MAX_JOINTS = 2, 16
MASK_BITS = 32
"""Capsules in one column of an obstacle's mask."""


class Rows(NamedTuple):
    """First rows of the parts; "per joint" means one column per joint."""

    header: int = 0  # see HEADER
    settings: int = 1  # of the safety layer, see SETTING
    arms: int = 2  # one entry after another, see ARM_ENTRY
    lower: int = 3  # lower joint limits [rad or m], per joint
    upper: int = 4  # upper joint limits
    speed: int = 5  # largest joint speeds [rad/s or m/s]
    step: int = 6  # scratch: the joint step of the guard
    stepped: int = 7  # scratch: the joints after that step
    part: int = 8  # scratch: part of a step; columns from MAX_JOINTS on: a sample of the search in joint space
    after: int = 9  # scratch: joints after a part
    before: int = 10  # scratch: joints before a part
    active: int = 11  # scratch: active rows of the quadratic program
    previous: int = 12  # joint speeds of the last command
    sliding: int = 13  # 1 for a joint that slides, 0 for a joint that turns
    tcps: int = 14  # one row per arm: pose (8) of its tcp
    weight: int = 16  # one row per joint: weight of the quadratic program
    chains: int = 32  # kinematic chains, arm after arm, see `kinematics.CHAIN`
    desired: int = 60  # wanted joint speeds
    levers: int = 61  # largest distance [m] that any point moved by a joint ever has from its axis
    last_look: int = 62  # joints at the last look at everything; then see LAST_LOOK
    posed: int = 63  # joints that the frames belong to
    frames: int = 64  # one row per joint, see `kinematics.FRAME`
    body: int = 84  # one row per capsule, see CAPSULE
    placed: int = 148  # one row per capsule, where it is now, see PLACED
    placed_next: int = 212  # one row per capsule, where it is after a step, see PLACED
    factor: int = 276  # scratch: Cholesky factor of the quadratic program
    obstacles: int = 308  # one row per obstacle, see `shapes.OBSTACLE`; what follows starts at rows of the header


class HeaderColumns(NamedTuple):
    """Columns of the header: counts, and the first rows of the parts behind the obstacles."""

    arms: int = 0
    joints: int = 1
    capsules: int = 2
    obstacles: int = 3
    pairs: int = 4  # pairs of the robot's own capsules that may hit each other
    near: int = 5  # near pairs found last
    first_pair: int = 6  # see PAIR
    first_near: int = 7  # see NEAR_PAIR
    first_bound: int = 8  # rows of the quadratic program, see `qp.QP`
    first_vertex: int = 9  # vertices (3) of the meshes [m]
    first_corner: int = 10  # corners (3) of the capsules' hulls [m], `convex_distance.PER_ROW` in a row
    corner_rows: int = 11
    proofs: int = 12  # steps of proofs of edges in joint space so far: the measure of their work


class SettingColumns(NamedTuple):
    """Columns of the settings, see `SafetySettings`; columns from `width` on are free."""

    shell: int = 0  # [m]
    alpha: int = 1  # [1/s]
    buffer: int = 2  # [m]
    limit_gain: int = 3  # [1/s], at most one over the period of the commands
    rotation_weight: int = 4  # [m^2]
    rest_weight: int = 5  # [m^2]
    decay: int = 6
    halvings: int = 7
    slew: int = 8  # largest change of a joint's speed from one command to the next [rad/s]
    self_margin: int = 9  # most [m] that any pair of the robot's own capsules is asked to keep, see PAIR
    width: int = 10


class ArmEntry(NamedTuple):
    """Columns of an arm's entry; the entry of arm k starts at column `k * width`."""

    first_joint: int = 0
    joints: int = 1
    chain: int = 2  # first row of its chain
    width: int = 3


class LastLookColumns(NamedTuple):
    """Columns of the last look at everything, behind the joints."""

    slack: int = 16  # smallest slack then [m]
    valid: int = 17  # 1 if the slack holds for the present obstacles and nothing was near
    moving: int = 18  # 1 if an obstacle moves


class CapsuleColumns(NamedTuple):
    """Columns of a capsule of the body, in the frame that it moves with."""

    arm: int = 0
    frame: int = 1  # joint whose frame it moves with, counted through all arms; -1: the fixed base
    a: int = 2  # one end of the core (3) [m]
    b: int = 5  # the other end (3) [m]
    radius: int = 8  # [m]
    ball: int = 9  # radius [m] of the ball about the middle of the core that contains the capsule
    first_corner: int = 10  # of the hull that bounds the capsule's content too, counted from HEADER.first_corner on
    corners: int = 11  # number of corners of that hull; 0: there is none
    rounding: int = 12  # rounding radius of that hull [m]


class PlacedColumns(NamedTuple):
    """Columns of a placed capsule, in the world; the ball about all that moves stands in the first row only."""

    a: int = 0  # one end of the core (3) [m]
    b: int = 3  # the other end (3) [m]
    center: int = 6  # middle of the core (3) [m]
    reach: int = 9  # longest displacement [m] of any point of the core during a step
    all_center: int = 10  # center (3) [m] of a ball that contains all capsules that move
    all_radius: int = 13  # its radius [m]
    origin: int = 14  # origin (3) [m] of the frame, of a capsule with a hull
    rotation: int = 17  # quaternion (4) wxyz of the frame, of a capsule with a hull
    swing: int = 21  # displacement [m] of a point of the hull beyond `reach`


class PairColumns(NamedTuple):
    """Columns of a pair of the robot's own capsules."""

    first: int = 0
    second: int = 1
    margin: int = 2  # distance to keep [m]


class NearPairColumns(NamedTuple):
    """Columns of a near pair: a capsule with an obstacle, or with another capsule of the robot."""

    self_pair: int = 0  # 1 if the other is a capsule of the robot, 0 if it is an obstacle
    capsule: int = 1
    other: int = 2  # the obstacle, or the other capsule
    distance: int = 3  # [m]
    margin: int = 4  # distance to keep [m]
    normal: int = 5  # unit normal (3) from the other to the capsule
    t: int = 8  # parameter in [0, 1] of the closest point on the capsule's core
    s: int = 9  # the same on the core of the other capsule
    exact: int = 10  # 1 if distance and normal are those of the hulls; then the points are
    point: int = 11  # closest point (3) of the capsule's hull [m]
    other_point: int = 14  # closest point (3) of the other capsule's hull or core [m]


ROW, HEADER, SETTING, ARM_ENTRY, LAST_LOOK = Rows(), HeaderColumns(), SettingColumns(), ArmEntry(), LastLookColumns()
CAPSULE, PLACED, PAIR, NEAR_PAIR = CapsuleColumns(), PlacedColumns(), PairColumns(), NearPairColumns()


def robot_arrays(
    arms: Sequence[Arm],
    bodies: Sequence[Body],
    packed: Packed,
    *,
    masks: Sequence[int] = (),
    margin: float = 0.0,
    pairs: Sequence[tuple[int, int]] = (),
    settings: ArrayLike = (),
) -> np.ndarray:
    """Return the array of a robot among obstacles.

    Args:
        arms: the arms.
        bodies: their bodies, in the same order.
        packed: the obstacles.
        masks: per obstacle the capsules, counted through all bodies, that may touch it, as bits of a number.
        margin: safety distance [m] from obstacles without a margin of their own.
        pairs: capsules that may hit each other, counted through all bodies.
        settings: (k,) the row of the settings, see SETTING.

    Raises:
        BadOption: too many arms, joints or capsules.
        BadModel: a body of another arm.
    """
    count, joints = sum(len(body) for body in bodies), sum(arm.dof for arm in arms)
    if len(arms) > MAX_ARMS or count > MAX_CAPSULES or joints > MAX_JOINTS:
        reason = (
            f"{len(arms)} arms, {count} capsules and {joints} joints; "
            f"allowed are {MAX_ARMS}, {MAX_CAPSULES} and {MAX_JOINTS}"
        )
        raise BadOption("robot", reason)
    for arm, body in zip(arms, bodies, strict=True):
        if len(body) and body.rows[:, BODY.frame].max() >= arm.dof:
            reason = f"a capsule moves with joint {body.rows[:, BODY.frame].max():g}; {arm.name!r} has {arm.dof}"
            raise BadModel("body", "rows", reason)
    work = np.zeros((ROW.obstacles + len(pairs), WIDTH))
    header = work[ROW.header]
    header[HEADER.arms], header[HEADER.joints], header[HEADER.capsules] = len(arms), joints, count
    header[HEADER.pairs], header[HEADER.first_pair] = len(pairs), ROW.obstacles
    work[ROW.settings, : np.size(settings)] = settings
    work[ROW.posed] = np.nan
    if len(pairs):
        work[ROW.obstacles :, PAIR.first : PAIR.second + 1] = pairs
        work[ROW.obstacles :, PAIR.margin] = _pair_margins(bodies, pairs, work[ROW.settings, SETTING.self_margin])
    _lay_arms(work, arms, bodies)
    hulls = [hull for body in bodies for hull in body.hulls or [None] * len(body)]
    return with_obstacles(with_hulls(work, hulls), packed, masks, margin)


def _pair_margins(bodies: Sequence[Body], pairs: Sequence[tuple[int, int]], usual: float) -> list[float]:
    """The distance [m] that each pair of capsules, counted through all bodies, keeps."""
    least, first = {}, 0
    for body in bodies:
        least.update({(first + i, first + j): margin for (i, j), margin in body.margins.items()})
        first += len(body)
    return [min(usual, least.get((int(i), int(j)), usual)) for i, j in pairs]


def with_hulls(robot: np.ndarray, hulls: Sequence[Hull | None]) -> np.ndarray:
    """Return the array of a robot, without obstacles and hulls so far, with the hulls of its capsules.

    Args:
        robot: array of the robot.
        hulls: per capsule; shared ones are stored once.
    """
    rows, known, end = [], {}, len(robot)
    for capsule, hull in zip(robot[ROW.body :], hulls, strict=False):
        if hull is None:
            continue
        if id(hull) not in known:
            known[id(hull)] = len(rows)
            block = np.zeros((-(-len(hull.corners) // PER_ROW), WIDTH))
            numbers = np.zeros((len(block), 3 * PER_ROW))
            numbers.reshape(-1)[: hull.corners.size] = np.ravel(hull.corners)
            block[:, : 3 * PER_ROW] = numbers
            rows.extend(block)
        capsule[CAPSULE.first_corner], capsule[CAPSULE.corners] = known[id(hull)], len(hull.corners)
        capsule[CAPSULE.rounding] = hull.rounding
    robot[ROW.header, HEADER.first_corner], robot[ROW.header, HEADER.corner_rows] = end, len(rows)
    return np.vstack([robot, *rows]) if rows else robot


def with_obstacles(robot: np.ndarray, packed: Packed, masks: Sequence[int], margin: float) -> np.ndarray:
    """Return a copy of a robot's array among other obstacles.

    Args:
        robot: array of the robot.
        packed: the obstacles.
        masks: see `robot_arrays`.
        margin: see `robot_arrays`.
    """
    joints, capsules, pairs = (int(robot[ROW.header, k]) for k in (HEADER.joints, HEADER.capsules, HEADER.pairs))
    k, old = len(packed.rows), int(robot[ROW.header, HEADER.first_pair])
    corner_rows = int(robot[ROW.header, HEADER.corner_rows])
    near = capsules * k + pairs
    first_pair = ROW.obstacles + k
    first_corner = first_pair + pairs
    first_near = first_corner + corner_rows
    first_bound = first_near + near
    first_vertex = first_bound + near + 2 * joints
    work = np.zeros((first_vertex + len(packed.vertices), WIDTH))
    work[: ROW.obstacles] = robot[: ROW.obstacles]
    header, look, rows = work[ROW.header], work[ROW.last_look], work[ROW.obstacles : first_pair]
    header[HEADER.obstacles], header[HEADER.pairs], header[HEADER.near] = k, pairs, 0
    header[HEADER.first_pair], header[HEADER.first_near] = first_pair, first_near
    header[HEADER.first_bound], header[HEADER.first_vertex] = first_bound, first_vertex
    header[HEADER.first_corner] = first_corner
    velocities, own_margins = packed.rows[:, OBSTACLE.velocity : OBSTACLE.ball], packed.rows[:, OBSTACLE.own_margin]
    look[LAST_LOOK.valid], look[LAST_LOOK.moving] = 0.0, float(velocities.any())
    rows[:, : OBSTACLE.packed] = packed.rows
    # vertices lie in the same array: meshes know their rows in it
    rows[:, OBSTACLE.first_vertex] += first_vertex
    for column in (0, 1):
        bits = [mask >> MASK_BITS * column & (1 << MASK_BITS) - 1 for mask in masks]
        rows[:, OBSTACLE.mask + column] = bits if bits else 0
    rows[:, OBSTACLE.margin] = np.where(own_margins < 0, margin, own_margins)
    work[first_pair:first_near] = robot[old : old + pairs + corner_rows]
    work[first_vertex:, :3] = packed.vertices
    return work


def _lay_arms(work: np.ndarray, arms: Sequence[Arm], bodies: Sequence[Body]) -> None:
    joint, chain, capsule = 0, ROW.chains, ROW.body
    for k, (arm, body) in enumerate(zip(arms, bodies, strict=True)):
        entry = work[ROW.arms, ARM_ENTRY.width * k : ARM_ENTRY.width * (k + 1)]
        entry[ARM_ENTRY.first_joint], entry[ARM_ENTRY.joints], entry[ARM_ENTRY.chain] = joint, arm.dof, chain
        columns, slides = slice(joint, joint + arm.dof), arm.chain[:-1, CHAIN.kind] == PRISMATIC
        work[ROW.lower, columns], work[ROW.upper, columns] = arm.lower, arm.upper
        work[ROW.speed, columns] = arm.velocity_limits
        work[chain : chain + arm.dof + 1, : CHAIN.width] = arm.chain
        work[ROW.sliding, columns] = arm.chain[:-1, CHAIN.kind]
        rows = work[capsule : capsule + len(body)]
        rows[:, CAPSULE.arm] = k
        rows[:, CAPSULE.frame] = np.where(body.rows[:, BODY.frame] < 0, -1, body.rows[:, BODY.frame] + joint)
        lay_capsules(rows, body.rows[:, BODY.a : BODY.width])
        # from joint to joint, then to the farthest point of a capsule; a slide may be anywhere in its range
        offsets = np.linalg.norm(arm.chain[:, CHAIN.offset : CHAIN.kind], axis=1)
        offsets[:-1] += np.where(slides, np.maximum(abs(arm.lower), abs(arm.upper)), 0.0)
        ends = body.rows[:, BODY.a : BODY.radius].reshape(-1, 2, 3)
        extents = np.linalg.norm(ends, axis=2).max(axis=1) if len(body) else np.zeros(1)
        if body.hulls:  # a core lies within its capsule, the hull's points reach its surface
            extents = extents + np.where([hull is not None for hull in body.hulls], body.rows[:, BODY.radius], 0.0)
        beyond = np.append(np.cumsum(offsets[:0:-1])[::-1], 0.0)[: arm.dof]
        levers = np.where(np.isfinite(beyond), beyond, 1e6) + extents.max()
        work[ROW.levers, columns] = np.where(slides, 1.0, levers)
        joint, chain, capsule = joint + arm.dof, chain + arm.dof + 1, capsule + len(body)


def lay_capsules(rows: np.ndarray, capsules: np.ndarray) -> None:
    """Write capsules into rows of the body.

    Args:
        rows: (m, WIDTH) rows of the body, see CAPSULE.
        capsules: (m, 7) ends and radii, see `body.TOOL_CAPSULE`.
    """
    cores = capsules[:, TOOL_CAPSULE.b : TOOL_CAPSULE.radius] - capsules[:, TOOL_CAPSULE.a : TOOL_CAPSULE.b]
    rows[:, CAPSULE.a : CAPSULE.ball] = capsules
    rows[:, CAPSULE.ball] = 0.5 * np.linalg.norm(cores, axis=1) + capsules[:, TOOL_CAPSULE.radius]
