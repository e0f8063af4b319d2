"""What is read of a simulation after each step, in one compiled pass: this runs fifty times per simulated second."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..planner.chain import forward
from ..planner.jit import kernel
from ..planner.screw import translation


class State(NamedTuple):
    """The measured state; the arrays are new at each reading.

    Attributes:
        joint_positions: (n_arms, dof) [rad].
        joint_velocities: (n_arms, dof) [rad/s].
        tcp_pose: (n_arms, 7) x y z [m] and wxyz, its sign on the side of the home pose.
        gripper_opening: (n_arms,) gap between the finger pads [m].
        object_pose: (n_objects, 7) x y z [m] and wxyz with w >= 0.
        object_velocity: (n_objects, 3) [m/s].
    """

    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    tcp_pose: np.ndarray
    gripper_opening: np.ndarray
    object_pose: np.ndarray
    object_velocity: np.ndarray


@kernel
def _face(quaternion, reference):
    """Give a quaternion the sign that is nearer to a reference."""
    dot = 0.0
    for k in range(4):
        dot += quaternion[k] * reference[k]
    if dot < 0.0:
        for k in range(4):
            quaternion[k] = -quaternion[k]


@kernel
def read_arm(qpos, qvel, site_xmat, geom_xpos, chain, frames, index, home, offset, out):
    """One arm into `out` (2 dof + 8,): joints, speeds, tcp pose, opening.

    The tcp is the forward kinematics of these joints: MuJoCo's own frames are one physics step older than its
    positions. `index` (2 dof + 3,) holds the addresses of positions and speeds, the site and the two pads; `home`
    (4,) the quaternion whose side the tcp's is given; `offset` [m] turns the distance of the pads into their gap.
    """
    dof = (len(index) - 3) // 2
    for j in range(dof):
        out[j] = qpos[index[j]]
        out[dof + j] = qvel[index[dof + j]]
    x = forward(chain, out[:dof], frames)
    place, tcp = translation(x), 2 * dof
    site, left, right = index[2 * dof], index[2 * dof + 1], index[2 * dof + 2]
    gap = 0.0
    for k in range(3):
        out[tcp + k] = place[k]
        # the fingers close along the x axis of the tcp
        gap += (geom_xpos[left, k] - geom_xpos[right, k]) * site_xmat[site, 3 * k]
    for k in range(4):
        out[tcp + 3 + k] = x[k]
    _face(out[tcp + 3 : tcp + 7], home)
    out[tcp + 7] = max(0.0, abs(gap) + offset)


@kernel
def read_objects(qpos, qvel, places, dofs, poses, velocities):
    """All free bodies: poses (n, 7) with w >= 0 and linear velocities (n, 3), at these addresses."""
    for i in range(len(places)):
        sign = -1.0 if qpos[places[i] + 3] < 0.0 else 1.0
        for k in range(3):
            poses[i, k] = qpos[places[i] + k]
            velocities[i, k] = qvel[dofs[i] + k]
        for k in range(4):
            poses[i, 3 + k] = sign * qpos[places[i] + 3 + k]
