"""Measurements of the simulator at every control tick of an episode: the raw material of all metrics."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ...envs.mujoco_library import mujoco
from ...envs.simulation.moving_obstacles import KINDS, described
from ...planner import Box, Capsule, Shape, Sphere


@dataclass(frozen=True, slots=True, eq=False)
class Trace:
    """Measurements of an episode at n control ticks, including the start.

    Attributes:
        time: (n,) simulated time [s].
        joints: (n, m) measured positions of all the robot's joints, including fingers and parked arms [rad, m].
        columns: (n_arms, dof) columns of `joints` that belong to the working arms.
        tcp: (n, n_arms, 7) tool poses in the world, x y z [m] and wxyz.
        objects: (n, n_objects, 7) object poses in the world.
        held: (n, n_arms, n_objects) True if the fingers touch the object, by the simulator's contacts.
        active: (n, n_obstacles) True if the obstacle is present.
        obstacles: (n, n_obstacles, 7) obstacle poses in the world, also of obstacles that are parked.
        kinds: (n_obstacles,) shape code, see `envs.simulation.moving_obstacles.KINDS`; 0: not used in this episode.
        sizes: (n_obstacles, 3) size [m], as observed.
    """

    time: np.ndarray
    joints: np.ndarray
    columns: np.ndarray
    tcp: np.ndarray
    objects: np.ndarray
    held: np.ndarray
    active: np.ndarray
    obstacles: np.ndarray
    kinds: np.ndarray
    sizes: np.ndarray

    @property
    def dt(self) -> float:
        """Time between ticks [s]; 0 for a trace of one tick."""
        return float(self.time[1] - self.time[0]) if len(self.time) > 1 else 0.0

    def shape(self, slot: int) -> Shape:
        """Return the shape of an obstacle of this episode."""
        x, y, z = (float(value) for value in self.sizes[slot])
        kind = {code: shape for shape, code in KINDS.items()}[float(self.kinds[slot])]
        return Box((x, y, z)) if kind is Box else Capsule(x, z) if kind is Capsule else Sphere(x)

    def save(self, path: Path) -> None:
        """Write the trace as a compressed .npz: numbers as float32, flags unchanged."""
        arrays = {field.name: getattr(self, field.name) for field in fields(self)}
        small = {key: a.astype(np.float32) if a.dtype == np.float64 else a for key, a in arrays.items()}
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez_compressed(path, **small)

    @staticmethod
    def load(path: Path) -> Trace:
        """Return a saved trace."""
        with np.load(path, allow_pickle=False) as file:
            arrays = {field.name: file[field.name] for field in fields(Trace)}
        return Trace(**{key: a.astype(np.float64) if a.dtype == np.float32 else a for key, a in arrays.items()})


def robot_addresses(sim: Any) -> np.ndarray:
    """Return the addresses in `qpos` of all joints that belong neither to an object nor to a bead, in order."""
    places = sim.model.jnt_qposadr[sim.model.body_jntadr[sim.scene.objects]]
    free = (places[:, None] + np.arange(7)).ravel()
    return np.setdiff1d(np.arange(sim.model.nq), np.concatenate([free, sim.scene.beads.ravel()]))


class TraceRecorder:
    """Recorder of an episode; call it with the environment and its observation at the start and after each step."""

    def __init__(self, env: Any):
        base = env.unwrapped
        self._sim, self._dt = base.sim, base.control_dt
        scene, model = self._sim.scene, self._sim.model
        self._addresses = robot_addresses(self._sim)
        self._columns = np.array([np.searchsorted(self._addresses, arm.qpos) for arm in scene.arms])
        self._mocap = model.body_mocapid[scene.obstacles[:, 0]]
        self._rows: list[tuple[np.ndarray, ...]] = []

    def __call__(self, env: Any, observation: Any) -> None:
        """Record the current state."""
        sim = self._sim
        state, data = sim.read(), sim.data
        places = np.hstack([data.mocap_pos[self._mocap], data.mocap_quat[self._mocap]])
        row = (data.qpos[self._addresses], state.tcp_pose, state.object_pose, sim.held())
        self._rows.append((*row, sim.obstacles.active.copy(), places))

    def trace(self) -> Trace:
        """Return the recorded trace."""
        joints, tcp, objects, held, active, places = (np.array(column) for column in zip(*self._rows, strict=True))
        kinds, sizes = np.zeros(active.shape[1]), np.zeros((active.shape[1], 3))
        for slot, each in enumerate(self._sim.obstacles.scheduled_obstacles):
            kinds[slot], sizes[slot] = KINDS[type(each.shape)], described(each.shape)
        time = self._dt * np.arange(len(joints))
        return Trace(time, joints, self._columns, tcp, objects, held, active, places, kinds, sizes)


def geom_poses(sim: Any, trace: Trace, ticks: np.ndarray, geoms: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return the poses of geoms at some ticks, by MuJoCo's forward kinematics.

    The running simulation is not touched.

    Args:
        sim: the simulation.
        trace: the episode.
        ticks: (t,) indices of ticks.
        geoms: (g,) indices of geoms.

    Returns:
        Positions (t, g, 3) [m] and rotation matrices (t, g, 3, 3).
    """
    model, data = sim.model, mujoco.MjData(sim.model)
    robot = robot_addresses(sim)
    free = (model.jnt_qposadr[model.body_jntadr[sim.scene.objects]][:, None] + np.arange(7)).ravel()
    places, turns = np.empty((len(ticks), len(geoms), 3)), np.empty((len(ticks), len(geoms), 3, 3))
    for row, tick in enumerate(ticks):
        data.qpos[robot], data.qpos[free] = trace.joints[tick], trace.objects[tick].ravel()
        mujoco.mj_kinematics(model, data)
        places[row], turns[row] = data.geom_xpos[geoms], data.geom_xmat[geoms].reshape(-1, 3, 3)
    return places, turns
