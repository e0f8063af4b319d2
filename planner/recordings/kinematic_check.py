"""Recordings against the robot: reach, limits of the joints, and poses against joints.

Screws do not depend on where base and tool frame are: the motion between two samples is conjugate to itself in any
other frame of base or tool, so that its angle, and its travel along the axis, are the same whichever frames were
recorded. Not in the paper.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..control.reachability import max_reach
from ..errors import BadDemonstration, told_apart
from ..geometry import dualquat as dq
from ..geometry.dualquat import screw_parameters
from ..geometry.pose import Pose, PosePath
from ..robot.arm import Arm
from ..robot.kinematics import CHAIN, PRISMATIC
from .recording import Blame

SAME_ANGLE, SAME_TRAVEL = 0.1, 0.02
"""Differences [rad] and [m] of two screws that count as the recorder's inaccuracy."""
STRAIGHT = 0.2
"""Angle [rad] below which a screw's axis is too uncertain for its travel to be compared."""
HALF_TURN = 3.0
"""Angle [rad] beyond which the direction of a screw's axis is uncertain."""
LEVER = 0.5
"""Largest distance [m] of two tool frames."""
ASIDE = 0.002
"""Distance [m] of a recorded base from the assumed one that is none: tool frames of two models differ by as much."""
DOUBTFUL = "only up to another base and another tool frame: are its quaternions wxyz?"
"""What is said where screws agree, and neither a base nor a tool frame alone explains the poses."""
LOOKS = 200
"""Number of samples, about, that are compared with the one in the middle of the way."""

LONG_TOOL = 0.2
"""Largest distance [m] of the recorded frame beyond the tcp of a robot's usual gripper."""
JUMP, JUMP_SPEED = (0.05, 0.5), (5.0, 30.0)
"""Step [m], [rad] of a hand between two samples, and its speed [m/s], [rad/s], that together no hand moves by."""
FASTEST, HANDS_TURN, BLINK = 5.0, 17.5, 0.02
"""Speed [m/s], [rad/s] that no hand keeps up over this time [s]."""
USUAL = 3.0
"""Mean speed [m/s] that no hand keeps up over a recording."""
NEAR, SHARE = 0.02, 0.95
"""Distance [m] of a second pose of the hand, over this share of the samples; a fixture's would not move along."""
STIFF = (1e-3, 0.02)
"""Change [m], [rad] of a pose relative to the hand up to which it is fixed to it."""
MOVED = 0.05
"""Way [m] of a hand beyond which it shows what moves along with it."""
HOLES, HOLE = 10.0, 0.01
"""Multiple of the usual step of time, and way [m] of the hand meanwhile, of a gap that is named."""
FAR, TINY = 3.0, 0.01
"""Extents [m] of a hand's way from which on, and up to which, its unit is asked about where no robot is known."""
SLACK = 0.1
"""Excess [rad or m] of a joint's limit that counts as another model's, or the controller's, inaccuracy."""
HASTE, WINDOW = 2.0, 0.2
"""Multiple of a joint's largest speed that no robot reaches over this time [s]."""


def extent_of(path: PosePath) -> float:
    """Return the diagonal [m] of the box around a path."""
    return float(np.linalg.norm(np.ptp(path.positions, axis=0)))


def reach_in_words(path: PosePath, time: np.ndarray, arm: Arm | None, unit: str, blame: Blame) -> str:
    """Return how far a hand moves, in words.

    Args:
        path: of the hand, in any frame that stands still.
        time: (n,) [s].
        arm: the robot, None if it is not known.
        unit: of the positions that the user or the file names, "" if it was only assumed to be meters.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: no arm of this robot moves as far; or no arm at all, and nothing names the unit; or the hand
            jumps.
    """
    extent, way = extent_of(path), float(np.linalg.norm(np.diff(path.positions, axis=0), axis=1).sum())
    if_other = f"cm or mm (--units), {extent / 100.0:.2g} or {extent / 1000.0:.2g} m"
    asked = f"are the positions in {unit or if_other}? "
    far = f"moves over {extent:.3g} m"
    most = np.inf if arm is None else 2.0 * (max_reach(arm) + LONG_TOOL)
    if arm is not None and extent > most:
        raise blame(f"{far}; the {arm.name} reaches {max_reach(arm):.2f} m: {asked}another robot (--robot)?")
    if not unit and extent > FAR:
        raise blame(f"{far}, which is far for an arm: {asked}else say --units m")
    _check_jumps(path, time, blame)
    if way > USUAL * (time[-1] - time[0]):
        fast = f"travels {way:.3g} m in {time[-1] - time[0]:.3g} s"
        raise blame(f"{fast}, which no hand does: is the time in another unit (--time-unit, --rate)?")
    _check_haste(path, time, blame)
    doubt = "which is little" if extent < TINY else "which is far for an arm" if extent > FAR else ""
    doubt = f", {doubt}: are the positions in {unit or 'm'}?" if doubt else ""
    return f"the hand travels {way:.3g} m within {extent:.3g} m{doubt}"


def _check_jumps(path: PosePath, time: np.ndarray, blame: Blame) -> None:
    """Refuse steps that no hand makes: a tracker that lost it, two recordings in one, time in another unit."""
    steps, spans = dq.pose_distance(path.dqs[:-1], path.dqs[1:]), np.diff(time)
    for step, least, fastest, unit in zip(steps, JUMP, JUMP_SPEED, ("m", "rad"), strict=True):
        jumps = np.flatnonzero((step > least) & (step > fastest * spans))
        if len(jumps):
            k = int(jumps[0])
            moves = f"jumps by {step[k]:.3g} {unit} from sample {k} to {k + 1}, in {spans[k]:.3g} s"
            raise blame(f"{moves}: was it lost there, or is the time in another unit (--time-unit, --rate)?")


def _check_haste(path: PosePath, time: np.ndarray, blame: Blame) -> None:
    """Refuse speeds that no hand has, over a blink: time in another unit, or stamps in bursts."""
    ends = np.minimum(np.searchsorted(time, time + BLINK), len(time) - 1)
    spans = time[ends] - time
    moves = dq.pose_distance(path.dqs, path.dqs[ends])
    for moved, fastest, unit in zip(moves, (FASTEST, HANDS_TURN), ("m/s", "rad/s"), strict=True):
        fast = np.flatnonzero((spans >= BLINK) & (moved > fastest * spans))
        if len(fast):
            k = int(fast[0])
            moves_by = f"moves at {moved[k] / spans[k]:.3g} {unit} from sample {k} to {ends[k]}, in {spans[k]:.3g} s"
            raise blame(f"{moves_by}, which no hand does: is the time in another unit (--time-unit, --rate)?")
    steps, gaps = dq.pose_distance(path.dqs[:-1], path.dqs[1:])[0], np.diff(time)
    bursts = np.flatnonzero((steps > HOLE / 2.0) & (steps > FASTEST * gaps))
    if len(bursts):
        k = int(bursts[0])
        moves_by = f"moves by {1e3 * steps[k]:.3g} mm in {1e3 * gaps[k]:.3g} ms from sample {k} to {k + 1}"
        raise blame(f"{moves_by}, {steps[k] / gaps[k]:.3g} m/s, which no hand does: do the stamps come in bursts? "
                    "leave them out by --ignore and say --rate, or give the time of measurement")  # fmt: skip


def gaps_in_words(path: PosePath, time: np.ndarray) -> list[str]:
    """Return where samples are missing while the hand moved on, a line each.

    Args:
        path: of the hand.
        time: (n,) [s].
    """
    spans, ways = np.diff(time), np.linalg.norm(np.diff(path.positions, axis=0), axis=1)
    holes = np.flatnonzero((spans > HOLES * np.median(spans)) & (ways > HOLE))
    return [
        f"no samples from {time[k] - time[0]:.2f} to {time[k + 1] - time[0]:.2f} s, {spans[k]:.3g} s, "
        f"in which the hand moved on by {ways[k]:.2g} m"
        for k in holes
    ]


def check_object(
    name: str,
    path: PosePath,
    hand: PosePath,
    time: np.ndarray,
    gripper: np.ndarray | None,
    blame: Blame,
    way_out: str = "leave it out",
) -> None:
    """Refuse a path of no object: it jumps, or is another pose of the same hand.

    Args:
        name: of the object.
        path: n poses of the object.
        hand: n poses of the hand.
        time: (n,) [s].
        gripper: (n,) command; None if not recorded.
        blame: makes an error from a reason.
        way_out: what its user can do.

    Raises:
        BadDemonstration: one line says why.
    """
    steps, spans = np.linalg.norm(np.diff(path.positions, axis=0), axis=1), np.diff(time)
    jumps = np.flatnonzero((steps > JUMP[0]) & (steps > JUMP_SPEED[0] * spans))
    if len(jumps):
        k = int(jumps[0])
        reason = f"object {name!r} jumps by {steps[k]:.3g} m from sample {k} to {k + 1}, in {spans[k]:.3g} s"
        raise blame(f"{reason}: was it lost there? {way_out}")
    free = np.ones(len(time), dtype=bool) if gripper is None else np.asarray(gripper) < 0.0
    is_free = gripper is not None and float(steps_of(hand)[free[1:]].sum()) > MOVED
    looked = free if is_free else np.ones(len(time), dtype=bool)
    gaps = np.linalg.norm(path.positions - hand.positions, axis=1)[looked]
    is_near = float(steps_of(hand).sum()) > MOVED and float(np.mean(gaps < NEAR)) >= SHARE
    is_stiff = _moves_with(path, hand, looked)
    # what is fixed to a hand that is never known to be open may be held all the time, unless it is the hand itself
    if (is_near or is_stiff) if is_free else (is_near and (not is_stiff or gaps.max() < 0.1 * STIFF[0])):
        why = f"is within {1e3 * NEAR:.0f} mm of the hand" if is_near else "moves as if fixed to the hand"
        when = "while the gripper is open, too" if is_free else "all the time"
        reason = f"object {name!r} {why} {when}: a command, or another frame of the arm?"
        raise blame(f"{reason} {way_out}")


def steps_of(path: PosePath) -> np.ndarray:
    """Return the ways (n - 1,) [m] between samples."""
    return np.linalg.norm(np.diff(path.positions, axis=0), axis=1)


def _moves_with(path: PosePath, hand: PosePath, looked: np.ndarray) -> bool:
    """Return whether a pose stays where it is relative to the hand, or beside it, over some samples."""
    chosen = np.flatnonzero(looked)
    relative = [(hand[k].inverse() @ path[k]).dq for k in chosen]
    distance, angle = dq.pose_distance(np.array(relative), np.array(relative[:1] * len(relative)))
    return bool(distance.max() < STIFF[0] and angle.max() < STIFF[1]) and float(steps_of(hand).sum()) > MOVED


def limits_in_words(joints: np.ndarray, time: np.ndarray, arm: Arm, blame: Blame) -> str:
    """Return how joints lie within a robot's limits, in words.

    Args:
        joints: (n, dof) [rad or m].
        time: (n,) [s].
        arm: the robot.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: a joint is far beyond a limit, or faster than the robot moves.
    """
    turning = arm.chain[:-1, CHAIN.kind] != PRISMATIC
    in_degrees = np.where(turning, np.radians(joints), joints)
    is_degrees = bool(((in_degrees >= arm.lower) & (in_degrees <= arm.upper)).all())
    degrees = "in degrees (--angles deg)? " if is_degrees else ""
    excess = np.maximum(arm.lower - joints, joints - arm.upper)
    k, j = (int(each) for each in np.unravel_index(excess.argmax(), excess.shape))
    words = f"within the limits of the {arm.name}"
    if excess[k, j] > 0.0:
        limit, unit = (arm.lower if joints[k, j] < arm.lower[j] else arm.upper)[j], "rad" if turning[j] else "m"
        one, other = told_apart(joints[k, j], limit, 2)
        words = f"joint {j + 1} is {one} {unit} at sample {k}, its limit {other} {unit}"
        if excess[k, j] > SLACK:
            raise blame(f"{words}, by the {arm.name}: {degrees}another robot (--robot), other joints or zeros?")
        words = f"beyond a limit of the {arm.name} by little: {words}"
    ratio, k, j = _haste(np.where(turning, np.unwrap(joints, axis=0), joints), time, arm)
    if ratio > HASTE:
        fast, unit = arm.velocity_limits[j], "rad/s" if turning[j] else "m/s"
        moves = f"joint {j + 1} moves by {ratio * fast:.3g} {unit} from sample {k} on, at most {fast:.3g} {unit}"
        raise blame(f"{moves} by the {arm.name}: {degrees}time in another unit (--time-unit, --rate)?")
    return words


def _haste(joints: np.ndarray, time: np.ndarray, arm: Arm) -> tuple[float, int, int]:
    """Return the largest mean speed over a while as a multiple of its limit, its first sample and its joint."""
    ends = np.minimum(np.searchsorted(time, time + WINDOW), len(time) - 1)
    starts = np.flatnonzero(ends > np.arange(len(time)))
    if not len(starts):
        return 0.0, 0, 0
    moved = np.abs(joints[ends[starts]] - joints[starts])
    spans = np.maximum(time[ends[starts]] - time[starts], min(WINDOW, time[-1] - time[0]))
    ratios = moved / spans[:, None] / arm.velocity_limits
    k, j = (int(each) for each in np.unravel_index(ratios.argmax(), ratios.shape))
    return float(ratios[k, j]), int(starts[k]), j


def joints_path(arm: Arm, joints: np.ndarray) -> PosePath:
    """Return the tcp's path.

    Args:
        arm: the arm.
        joints: (n, dof) [rad or m].
    """
    return PosePath(np.array([arm.fk(row).dq for row in joints]))


def checked_against_joints(path: str | Path | None, key: str, poses: PosePath, joints: PosePath) -> str:
    """Return how well poses agree with those of the joints, in words.

    Args:
        path: of the file, for messages.
        key: of the poses, for messages.
        poses: n recorded poses of some frame of the hand, in any frame that stands still.
        joints: n poses of the tcp by forward kinematics.

    Raises:
        BadDemonstration: no choice of the two frames makes them agree.
    """
    middle = int(np.argmin(np.abs(joints.lengths() - 0.5 * joints.lengths()[-1])))
    for k in range(0, len(poses), max(1, len(poses) // LOOKS)):
        reason = _difference(*(path_[middle].inverse() @ path_[k] for path_ in (poses, joints)))
        if reason:
            raise BadDemonstration(path, key, f"contradicts the joints: from sample {middle} to {k} {reason}")
    distance, angle = dq.pose_distance(poses.dqs, joints.dqs)
    if distance.max() < SAME_TRAVEL and angle.max() < SAME_ANGLE:
        return f"agrees with the joints to {1e3 * distance.max():.1f} mm and {np.degrees(angle.max()):.1f} deg"
    mine, theirs = poses[middle], joints[middle]
    for other, frames in (
        (joints.moved(mine @ theirs.inverse()), "another base"),
        (joints.with_tool(theirs.inverse() @ mine), "another tool frame"),
    ):
        distance, angle = dq.pose_distance(poses.dqs, other.dqs)
        if distance.max() < SAME_TRAVEL and angle.max() < SAME_ANGLE:
            return f"agrees with the joints up to {frames}"
    return f"agrees with the joints {DOUBTFUL}"


def base_in(poses: PosePath, joints: PosePath) -> Pose:
    """Return where the base stood from which the joints reach recorded poses; as assumed if that explains them as well.

    Objects are recorded in the same world as the poses: a hand at an assumed base would grasp beside them.

    Args:
        poses: n recorded poses of the tcp in the world.
        joints: n poses of the tcp by forward kinematics, from the assumed base.

    Returns:
        `world_from_assumed`, with which `joints` moved are nearest to `poses`.
    """
    rows = dq.mul(poses.dqs, dq.conj(joints.dqs))
    rows *= np.where(rows[:, :4] @ rows[0, :4] < 0.0, -1.0, 1.0)[:, None]
    base = Pose(dq.normalized(rows.mean(axis=0)))
    apart, left = (dq.pose_distance(poses.dqs, path.dqs)[0].max() for path in (joints, joints.moved(base)))
    return base if left < min(SAME_TRAVEL, 0.5 * apart) and apart > ASIDE else Pose.identity()


def _difference(recorded: Pose, computed: Pose) -> str:
    """Return how two motions differ in what no choice of frames changes; "" if they agree."""
    one, other = screw_parameters(recorded.dq), screw_parameters(computed.dq)
    if abs(one.angle - other.angle) > SAME_ANGLE:
        turns = f"{np.degrees(one.angle):.1f} deg, the joints turn it by {np.degrees(other.angle):.1f} deg"
        return f"it turns by {turns}; another robot?"
    angle = min(one.angle, other.angle)
    if angle > STRAIGHT:
        # near half a turn the axis may have either direction
        mine, theirs = (abs(screw.travel) if angle > HALF_TURN else screw.travel for screw in (one, other))
        far = abs(mine - theirs) > SAME_TRAVEL
    else:
        mine, theirs = (float(np.linalg.norm(pose.position)) for pose in (recorded, computed))
        far = abs(mine - theirs) > SAME_TRAVEL + LEVER * max(one.angle, other.angle)
    if not far:
        return ""
    return (
        f"it moves by {mine:.3f} m, the joints move it by {theirs:.3f} m; is the path in meters, its quaternions wxyz?"
    )
