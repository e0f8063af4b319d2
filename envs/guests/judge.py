"""robosuite's own judge: its environment looks at the state of our physics."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from ..mujoco_library import mujoco
from ..simulation.simulation import Simulation


class Sight(NamedTuple):
    """State as robosuite sees it.

    Attributes:
        success: whether robosuite's `_check_success` holds at this instant.
        shaped: robosuite's shaped reward, in [0, 1]; 0 where it was not asked for.
        furniture: (n, 7) poses of the fixtures, x y z [m] and wxyz with w >= 0.
        joints: (n,) positions of the scene's joints [rad or m].
    """

    success: bool
    shaped: float
    furniture: np.ndarray
    joints: np.ndarray


class RobosuiteJudge:
    """Judge of states; it keeps nothing from one state to the next.

    Args:
        env: robosuite's environment of the task.
        furniture: (n,) body ids of the fixtures.
        joints: (n,) addresses of the scene's joints in `qpos`.
    """

    def __init__(self, env: Any, furniture: np.ndarray, joints: np.ndarray):
        self._env, self._furniture, self._joints = env, furniture, joints
        self._model, self._data = env.sim.model._model, env.sim.data._data

    def look(self, sim: Simulation, *, shaped: bool) -> Sight:
        """Judge the present state of a simulation of the same model.

        Obstacles are not shown to robosuite: its tasks have none.

        Args:
            sim: the simulation.
            shaped: whether the shaped reward is wanted.
        """
        model, data = self._model, self._data
        model.body_pos[:], model.body_quat[:] = sim.model.body_pos, sim.model.body_quat
        for name in ("qpos", "qvel", "act", "ctrl"):
            getattr(data, name)[:] = getattr(sim.data, name)
        # frames, contacts and velocities, but no forces: those depend on what was judged before
        mujoco.mj_fwdPosition(model, data)
        mujoco.mj_fwdVelocity(model, data)
        poses = np.column_stack([data.xpos[self._furniture], data.xquat[self._furniture]])
        poses[:, 3:] *= np.where(poses[:, 3:4] < 0.0, -1.0, 1.0)
        reward = float(np.clip(self._env.reward(None), 0.0, 1.0)) if shaped else 0.0
        return Sight(bool(self._env._check_success()), reward, poses, data.qpos[self._joints].copy())
