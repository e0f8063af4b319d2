"""What is read of a simulation after each step, in one compiled pass: this runs fifty times per simulated second."""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ..planner.jit import kernel


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
def _quaternion(m, out):
    """Quaternion wxyz of a rotation matrix (9,), from its largest diagonal combination."""
    trace = m[0] + m[4] + m[8]
    if trace > 0.0:
        s = 2.0 * math.sqrt(1.0 + trace)
        out[0], out[1], out[2], out[3] = 0.25 * s, (m[7] - m[5]) / s, (m[2] - m[6]) / s, (m[3] - m[1]) / s
    elif m[0] >= m[4] and m[0] >= m[8]:
        s = 2.0 * math.sqrt(1.0 + m[0] - m[4] - m[8])
        out[0], out[1], out[2], out[3] = (m[7] - m[5]) / s, 0.25 * s, (m[1] + m[3]) / s, (m[2] + m[6]) / s
    elif m[4] >= m[8]:
        s = 2.0 * math.sqrt(1.0 + m[4] - m[0] - m[8])
        out[0], out[1], out[2], out[3] = (m[2] - m[6]) / s, (m[1] + m[3]) / s, 0.25 * s, (m[5] + m[7]) / s
    else:
        s = 2.0 * math.sqrt(1.0 + m[8] - m[0] - m[4])
        out[0], out[1], out[2], out[3] = (m[3] - m[1]) / s, (m[2] + m[6]) / s, (m[5] + m[7]) / s, 0.25 * s


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
def read_arm(qpos, qvel, site_xpos, site_xmat, geom_xpos, index, home, offset, out):
    """One arm into `out` (2 dof + 8,): joints, speeds, tcp pose, opening.

    `index` (2 dof + 3,) holds the addresses of positions and speeds, the site and the two pads; `home` (4,) the
    quaternion whose side the tcp's is given; `offset` [m] turns the distance of the pads' centers into their gap.
    """
    dof = (len(index) - 3) // 2
    for j in range(dof):
        out[j] = qpos[index[j]]
        out[dof + j] = qvel[index[dof + j]]
    site, left, right = index[2 * dof], index[2 * dof + 1], index[2 * dof + 2]
    tcp = 2 * dof
    gap = 0.0
    for k in range(3):
        out[tcp + k] = site_xpos[site, k]
        # the fingers close along the x axis of the tcp
        gap += (geom_xpos[left, k] - geom_xpos[right, k]) * site_xmat[site, 3 * k]
    _quaternion(site_xmat[site], out[tcp + 3 : tcp + 7])
    _face(out[tcp + 3 : tcp + 7], home)
    out[tcp + 7] = max(0.0, abs(gap) + offset)


@kernel
def read_objects(qvel, xpos, xquat, bodies, dofs, poses, velocities):
    """All free bodies: poses (n, 7) with w >= 0 and linear velocities (n, 3)."""
    for i in range(len(bodies)):
        body = bodies[i]
        sign = -1.0 if xquat[body, 0] < 0.0 else 1.0
        for k in range(3):
            poses[i, k] = xpos[body, k]
            velocities[i, k] = qvel[dofs[i] + k]
        for k in range(4):
            poses[i, 3 + k] = sign * xquat[body, k]
