"""Actions into a simulation and states out of it at each step, compiled: this runs fifty times per second.

After `mj_step` the processor's caches hold the physics and nothing else, so every small array and every call costs five
times its cost in a loop. Hence one pass in each direction, and few arrays.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from ...planner.geometry.screw import translation
from ...planner.jit import kernel
from ...planner.robot.kinematics import forward


class State(NamedTuple):
    """The measured state; arrays are new at each reading, except `touching`.

    Attributes:
        joint_positions: (n_arms, dof) [rad].
        joint_velocities: (n_arms, dof) [rad/s].
        tcp_pose: (n_arms, 7) x y z [m] and wxyz, the sign on the side of the home pose.
        gripper_opening: (n_arms,) gap between the finger pads [m].
        object_pose: (n_objects, 7) x y z [m] and wxyz with w >= 0.
        object_velocity: (n_objects, 3) [m/s].
        touching: (owners, owners) 1 where two owners touch, the smaller first; updated in place.
        bead_position: (n_beads, 3) [m].
    """

    joint_positions: np.ndarray
    joint_velocities: np.ndarray
    tcp_pose: np.ndarray
    gripper_opening: np.ndarray
    object_pose: np.ndarray
    object_velocity: np.ndarray
    touching: np.ndarray
    bead_position: np.ndarray = np.zeros((0, 3))


@kernel
def command(action, full, bound, servos, grips, ctrl):
    """Write an action into `ctrl`.

    Args:
        action: (n_arms * (dof + 1),) per arm its joints, then its gripper: above 0 closes it, below 0 opens it to that
            fraction of the widest gap, 0 leaves it unchanged.
        full: (n_arms, dof) joint speeds [rad/s] of an entry 1.
        bound: joint entries are clipped to plus and minus this bound.
        servos: (n_arms, dof) indices of the joint speeds in `ctrl`.
        grips: (n_arms, fingers, 3) per finger its index in `ctrl` and its controls when open and when closed.
        ctrl: MuJoCo's controls, written to.

    Returns:
        -1, or the index of the first entry that is not finite; in this case nothing is written.
    """
    for k in range(len(action)):
        if not math.isfinite(action[k]):
            return k
    arms, dof = servos.shape
    for i in range(arms):
        first = i * (dof + 1)
        for j in range(dof):
            ctrl[servos[i, j]] = min(max(action[first + j], -bound), bound) * full[i, j]
        grip = action[first + dof]
        if grip != 0.0:
            part = min(-grip, 1.0) if grip < 0.0 else 0.0
            for finger in range(grips.shape[1]):
                opened, closed = grips[i, finger, 1], grips[i, finger, 2]
                ctrl[int(grips[i, finger, 0])] = closed + part * (opened - closed)
    return -1


@kernel
def _face(quaternion, reference):
    """Give a quaternion the sign nearer to a reference."""
    dot = 0.0
    for k in range(4):
        dot += quaternion[k] * reference[k]
    if dot < 0.0:
        for k in range(4):
            quaternion[k] = -quaternion[k]


@kernel
def read_arms(qpos, qvel, site_xmat, geom_xpos, chains, frames, index, homes, q, qdot, tcp, opening):
    """Read joints, velocities, tcp poses and finger gaps of all arms.

    The tcp is the forward kinematics of these joints: MuJoCo's own frames are one physics step older than its
    positions.

    Args:
        qpos: MuJoCo's positions.
        qvel: MuJoCo's velocities.
        site_xmat: (nsite, 9) MuJoCo's site rotations.
        geom_xpos: (ngeom, 3) MuJoCo's geom positions [m].
        chains: kinematic chain of each arm, see `Arm.chain`.
        frames: (dof, `FRAME.width`) workspace.
        index: (n, 2 dof + 3) addresses of positions and velocities, the site and the two pads.
        homes: (n, 5) quaternion that decides the tcp's sign, and offset [m] from the pads' distance to their gap.
        q: (n, dof) result: joints [rad].
        qdot: (n, dof) result: joint velocities [rad/s].
        tcp: (n, 7) result: x y z [m] and wxyz.
        opening: (n,) result: finger gaps [m].
    """
    arms, dof = q.shape
    for i in range(arms):
        for j in range(dof):
            q[i, j] = qpos[index[i, j]]
            qdot[i, j] = qvel[index[i, dof + j]]
        x = forward(chains[i], q[i], frames)
        place = translation(x)
        site, left, right = index[i, 2 * dof], index[i, 2 * dof + 1], index[i, 2 * dof + 2]
        gap = 0.0
        for k in range(3):
            tcp[i, k] = place[k]
            # the fingers close along the x axis of the tcp
            gap += (geom_xpos[left, k] - geom_xpos[right, k]) * site_xmat[site, 3 * k]
        for k in range(4):
            tcp[i, 3 + k] = x[k]
        _face(tcp[i, 3:7], homes[i])
        opening[i] = max(0.0, abs(gap) + homes[i, 4])


@kernel
def read_objects(qpos, qvel, index, geoms, owner, poses, velocities, touching):
    """Read poses and velocities of all free bodies, and all contacts.

    Args:
        qpos: MuJoCo's positions.
        qvel: MuJoCo's velocities.
        index: (n, 2) addresses of positions and velocities.
        geoms: (contacts, 2 or more) the two geoms of each contact.
        owner: (ngeom,) owner of each geom.
        poses: (n, 7) result: x y z [m] and wxyz with w >= 0.
        velocities: (n, 3) result: linear velocities [m/s].
        touching: (owners, owners) result: 1 where two owners touch, the smaller first.
    """
    for i in range(len(index)):
        place, dof = index[i, 0], index[i, 1]
        sign = -1.0 if qpos[place + 3] < 0.0 else 1.0
        for k in range(3):
            poses[i, k] = qpos[place + k]
            velocities[i, k] = qvel[dof + k]
        for k in range(4):
            poses[i, 3 + k] = sign * qpos[place + 3 + k]
    touching[:] = 0.0
    for i in range(len(geoms)):
        a, b = owner[geoms[i, 0]], owner[geoms[i, 1]]
        touching[min(a, b), max(a, b)] = 1.0
