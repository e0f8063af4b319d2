"""A scene being simulated by MuJoCo alone."""

from __future__ import annotations

import copy

import mujoco
import numpy as np

from ..planner.chain import FRAME
from .boxes import Box
from .scene import ARM, FINGERS, ArmIndex, compiled_scene
from .state import State, read_arm, read_objects

PHYSICS_DT = 0.002
PAIR_BASE = 100


def _pair_codes(owner: np.ndarray) -> np.ndarray:
    """(ngeom, ngeom) code of the two owners, 0 where their contact does not count."""
    low = np.minimum(owner[:, None], owner[None, :])
    high = np.maximum(owner[:, None], owner[None, :])
    ignored = (low == high) | ((low == ARM) & (high == FINGERS))
    return np.where(ignored, 0, low * PAIR_BASE + high)


class Simulation:
    """A scene being simulated: state in, physics, state out."""

    def __init__(self, robot: str, boxes: tuple[Box, ...]):
        self.scene = compiled_scene(robot, boxes)
        self.model = copy.copy(self.scene.model)
        self.data = mujoco.MjData(self.model)
        self._pair_codes = _pair_codes(self.scene.owner)
        arms, data, model = self.scene.arms, self.data, self.model
        self._widest = [self._measured_opening(arm) for arm in arms]
        self._offsets = [wide - self._pad_distance(arm) for wide, arm in zip(self._widest, arms, strict=True)]
        self._read_index = [np.array([*arm.qpos, *arm.qvel, arm.site, *arm.pads]) for arm in arms]
        self._home_side = [arm.arm.fk(q).quaternion for arm, q in zip(arms, self.scene.home, strict=True)]
        self._arm_views = (data.qpos, data.qvel, data.site_xmat, data.geom_xpos)
        self._frames = np.empty((arms[0].arm.dof, FRAME))
        self._object_places = model.jnt_qposadr[model.body_jntadr[self.scene.objects]]
        self._object_dofs = model.body_dofadr[self.scene.objects]

    def reset(self, joints: np.ndarray, object_poses: np.ndarray) -> None:
        """Put everything in place, at rest, with open grippers.

        Args:
            joints: (n_arms, dof) joint positions [rad].
            object_poses: (n_objects, 7) world poses, x y z [m] and wxyz.
        """
        mujoco.mj_resetData(self.model, self.data)
        for arm, q in zip(self.scene.arms, joints, strict=True):
            self.data.qpos[arm.qpos] = q
            self.data.act[arm.act] = q
            self.data.ctrl[arm.grip] = arm.opened
            self.data.qpos[arm.finger_qpos] = arm.opened
        for address, pose in zip(self._object_places, object_poses, strict=True):
            self.data.qpos[address : address + 7] = pose
        mujoco.mj_forward(self.model, self.data)

    def step(self, speeds: np.ndarray, grips: np.ndarray, substeps: int) -> None:
        """Hold joint speeds (n_arms, dof) [rad/s] and gripper commands (n_arms,) for some physics steps."""
        ctrl = self.data.ctrl
        for arm, speed, grip in zip(self.scene.arms, speeds, grips, strict=True):
            ctrl[arm.ctrl] = speed
            if grip != 0.0:
                ctrl[arm.grip] = arm.closed if grip > 0.0 else arm.opened
        mujoco.mj_step(self.model, self.data, substeps)

    def widest_opening(self, index: int) -> float:
        """Gap between the finger pads of an open gripper [m]."""
        return self._widest[index]

    def read(self) -> State:
        """The state now, in new arrays."""
        data, count, dof = self.data, len(self.scene.arms), self.scene.arms[0].arm.dof
        rows = np.empty((count, 2 * dof + 8))
        for k, arm in enumerate(self.scene.arms):
            index, home, offset = self._read_index[k], self._home_side[k], self._offsets[k]
            read_arm(*self._arm_views, arm.arm.chain, self._frames, index, home, offset, rows[k])
        poses, velocities = np.empty((len(self.scene.objects), 7)), np.empty((len(self.scene.objects), 3))
        read_objects(data.qpos, data.qvel, self._object_places, self._object_dofs, poses, velocities)
        tcp = 2 * dof
        return State(rows[:, :dof], rows[:, dof:tcp], rows[:, tcp : tcp + 7], rows[:, tcp + 7], poses, velocities)

    def contacts(self) -> set[tuple[int, int]]:
        """Who touches whom: pairs of owners, the smaller first.

        Contacts of a robot with itself and of anything with its own kind are left out.
        """
        geoms = self.data.contact.geom
        codes = set(self._pair_codes[geoms[:, 0], geoms[:, 1]].tolist())
        codes.discard(0)
        return {divmod(code, PAIR_BASE) for code in codes}

    def contact_name(self, pair: tuple[int, int]) -> str:
        """Name of a contact of two owners, as in `link5-block1`."""
        geoms = self.data.contact.geom
        hit = np.flatnonzero(self._pair_codes[geoms[:, 0], geoms[:, 1]] == pair[0] * PAIR_BASE + pair[1])[0]
        return "-".join(sorted(self.scene.labels[geom] for geom in geoms[hit]))

    def _pad_distance(self, arm: ArmIndex) -> float:
        left, right = self.data.geom_xpos[arm.pads[0]], self.data.geom_xpos[arm.pads[1]]
        closing = self.data.site_xmat[arm.site][::3]
        return abs(float((left - right) @ closing))

    def _measured_opening(self, arm: ArmIndex) -> float:
        """Gap of the open pads [m]; leaves the gripper open in the state."""
        mujoco.mj_resetData(self.model, self.data)
        for each in self.scene.arms:
            self.data.qpos[each.finger_qpos] = each.opened
        mujoco.mj_forward(self.model, self.data)
        return mujoco.mj_geomDistance(self.model, self.data, *arm.pads, 1.0, None)
