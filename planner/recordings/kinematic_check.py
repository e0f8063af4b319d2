"""Recorded poses against recorded joints: screws do not depend on where base and tool frame are.

The motion between two samples is conjugate to itself in any other frame of base or tool, so that its angle, and its
travel along the axis, are the same whichever frames were recorded. Not in the paper.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..errors import BadDemonstration
from ..geometry import dualquat as dq
from ..geometry.dualquat import screw_parameters
from ..geometry.pose import Pose, PosePath
from ..robot.arm import Arm

SAME_ANGLE, SAME_TRAVEL = 0.1, 0.02
"""Differences [rad] and [m] of two screws that count as the recorder's inaccuracy."""
STRAIGHT = 0.2
"""Angle [rad] below which a screw's axis is too uncertain for its travel to be compared."""
HALF_TURN = 3.0
"""Angle [rad] beyond which the direction of a screw's axis is uncertain."""
LEVER = 0.5
"""Largest distance [m] of two tool frames."""
DOUBTFUL = "only up to another base and another tool frame: are its quaternions wxyz?"
"""What is said where screws agree, and neither a base nor a tool frame alone explains the poses."""
LOOKS = 200
"""Number of samples, about, that are compared with the one in the middle of the way."""


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
