"""Compiled scenes, and where everything is in MuJoCo's arrays."""

from __future__ import annotations

import copy
import logging
from collections.abc import Iterable
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import mujoco
import numpy as np

from ...planner.geometry.shapes import Obstacle
from ...planner.robot.arm import Arm
from .arm_index import ArmIndex, arm_index
from .fixed_shapes import static_shapes
from .robots import robot_named
from .scene_objects import NOTHING, SceneSpec

WORLD, ARM, FINGERS, OTHER_ARM, OTHER_FINGERS, OBSTACLE, FURNITURE, BEAD, FIRST_OBJECT = range(9)
"""Who a geom belongs to: what is fixed to the world, the first arm, its fingers, the second arm, its fingers, an
obstacle, furniture, a bead, or object k as FIRST_OBJECT + k."""


@dataclass(frozen=True)
class CompiledScene:
    """A compiled scene; `model` is shared: copy it before changing it.

    Attributes:
        model: MuJoCo's model.
        arms: the arms that work.
        home: (n_arms, dof) the joints from which they start.
        parked: the arms that do nothing.
        parked_joints: (n_parked, dof) where they are held.
        objects: body ids of the free objects.
        furniture: mocap ids of the furniture.
        obstacles: (n, 3) body, solid geom and visible geom of each obstacle.
        beads: (n, 3) addresses of the beads' places in `qpos`.
        owner: (ngeom,) whose geom it is, see WORLD.
        labels: (ngeom,) names for messages.
        fixtures: what stands still for ever and is solid: a one-armed robot's own base and the floor left out, a
            two-armed robot's trunk included.
    """

    model: mujoco.MjModel
    arms: tuple[ArmIndex, ...]
    home: np.ndarray
    parked: tuple[ArmIndex, ...]
    parked_joints: np.ndarray
    objects: np.ndarray
    furniture: np.ndarray
    obstacles: np.ndarray
    beads: np.ndarray
    owner: np.ndarray
    labels: tuple[str, ...]
    fixtures: tuple[Obstacle, ...]


@lru_cache(maxsize=16)
def compiled_scene(robot: str, spec: SceneSpec = NOTHING, arms: tuple[str, ...] | None = None) -> CompiledScene:
    """The scene of a robot at a table with things; compiled once per process.

    Args:
        robot: one of `ROBOTS`.
        spec: what there is besides.
        arms: names of the arms that work, in the order of observations; None: the robot's first.

    Raises:
        UnknownName: no such robot.
        BadOption: it has no such arm.
    """
    kind = robot_named(robot)
    working = kind.checked_arms(arms, robot)
    env = _model_library().table_env(robot, kind.gripper, spec, kind.place(working))
    model, rob = copy.copy(env.sim.model._model), env.robots[0]
    indices = {side: arm_index(model, rob, side, kind.speeds, robot) for side in rob.arms}
    idle = tuple(side for side in rob.arms if side not in working)
    objects = np.array([_body_of(model, each.name) for each in spec.objects], dtype=np.int64)
    furniture = np.array([model.body(each.name).id for each in spec.furniture], dtype=np.int64)
    bodies = [model.body(f"obstacle{k}").id for k in range(spec.obstacles)]
    obstacles = np.array([(body, *_geoms(model, body)) for body in bodies], dtype=np.int64).reshape(-1, 3)
    beads = [model.body(f"bead{k}").id for k in range(spec.beads.count)] if spec.beads else []
    joints = model.body_jntadr[np.array(beads, dtype=np.int64)]
    places = model.jnt_qposadr[joints[:, None] + np.arange(3)].astype(np.int64)
    known = {**{int(body): FIRST_OBJECT + k for k, body in enumerate(objects)}, **dict.fromkeys(beads, BEAD)}
    known |= {**{int(body): FURNITURE for body in furniture}, **dict.fromkeys(bodies, OBSTACLE)}
    owner, labels = _owners(model, [indices[side] for side in (*working, *idle)], known)
    dof = len(kind.speeds)
    return CompiledScene(
        model=model,
        arms=tuple(indices[side] for side in working),
        home=np.array([kind.ready[side] for side in working]),
        parked=tuple(indices[side] for side in idle),
        parked_joints=np.array([kind.parked[side] for side in idle]).reshape(-1, dof),
        objects=objects,
        furniture=model.body_mocapid[furniture].astype(np.int64),
        obstacles=obstacles,
        beads=places,
        owner=owner,
        labels=labels,
        fixtures=static_shapes(model, np.flatnonzero(owner == WORLD)),
    )


def robot_arm(robot: str, index: int = 0) -> Arm:
    """The kinematics of a robot's arm as it stands at the table, tcp between the finger pads."""
    return compiled_scene(robot).arms[index].arm


def _model_library() -> Any:
    """The module that builds models, imported late: robosuite takes seconds and warns of optional things."""
    before = logging.root.manager.disable
    logging.disable(logging.WARNING)
    try:
        return import_module(".table_model", __package__)
    finally:
        logging.disable(before)


def _body_of(model: mujoco.MjModel, name: str) -> int:
    """Id of the body of an object; robosuite's own objects add a word to its name."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    return found if found >= 0 else model.body(f"{name}_main").id


def _geoms(model: mujoco.MjModel, body: int) -> range:
    return range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])


def _owners(
    model: mujoco.MjModel, arms: Iterable[ArmIndex], known: dict[int, int]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Of every geom its owner and its name for messages.

    Args:
        model: the compiled model.
        arms: those that work, then those that do not.
        known: the owners of bodies that are things.
    """
    indices = list(arms)
    parts = {body: ARM + 2 * k for k, index in enumerate(indices) for body in index.bodies}
    parts |= {body: FINGERS + 2 * k for k, index in enumerate(indices) for body in index.fingers}
    owner, labels = np.zeros(model.ngeom, dtype=np.int64), []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        name = model.body(body).name
        part = parts.get(body, ARM if len(indices) == 1 and name.startswith(("robot", "gripper")) else WORLD)
        owner[geom] = known.get(body, part)
        if body in known:
            labels.append(name.removesuffix("_main"))
        elif part in (FINGERS, OTHER_FINGERS):
            labels.append("fingers" if len(indices) == 1 else f"{indices[part // 2 - 1].side} fingers")
        elif name.startswith(("robot", "gripper")):
            labels.append(name.split("_", 1)[1])
        else:
            labels.append("table" if "table" in name else name or "world")
    return owner, tuple(labels)
