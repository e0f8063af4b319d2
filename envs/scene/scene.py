"""Compiled scenes, with the addresses of their parts in MuJoCo's arrays."""

from __future__ import annotations

import copy
import logging
import os
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from ...planner import Arm, Obstacle
from ...planner.deferred_imports import deferred
from ..mujoco_library import decimal_points, mujoco
from .arm_index import ArmIndex, arm_index
from .fixed_shapes import static_shapes
from .robots import Robot
from .scene_objects import NOTHING, SceneSpec

WORLD, ARM, FINGERS, OTHER_ARM, OTHER_FINGERS, OBSTACLE, FURNITURE, BEAD, FIRST_OBJECT = range(9)
"""Owners of geoms: the fixed world, the first arm, its fingers, the second arm, its fingers, an obstacle, furniture,
a bead, or object k as FIRST_OBJECT + k."""
KEPT = 8
"""Number of compiled scenes that a process keeps: each is one second's work, and up to 250 MB."""


@dataclass(frozen=True)
class CompiledScene:
    """A compiled scene; `model` is shared: copy it before changing it. Copies of the scene are the scene itself.

    Attributes:
        robot: the robot.
        spec: its contents besides robot and table.
        model: MuJoCo's model.
        arms: working arms.
        home: (n_arms, dof) start joints [rad] of the working arms.
        parked: idle arms.
        parked_joints: (n_parked, dof) joints [rad] at which the idle arms are held.
        objects: body ids of the free objects.
        furniture: mocap ids of the furniture.
        obstacles: (n, 3) body, collision geom and visual geom of each obstacle.
        beads: (n, 3) addresses of the beads' positions in `qpos`.
        owner: (ngeom,) owner of each geom, see `WORLD`.
        labels: (ngeom,) names of the geoms, for messages.
        fixtures: solids that never move; a one-armed robot's own base and the floor are excluded, a two-armed robot's
            trunk is included.
        recipe: function and arguments that it was compiled by, for pickles.
    """

    robot: Robot
    spec: SceneSpec
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
    recipe: tuple[Callable[..., CompiledScene], tuple[Any, ...]]

    def __copy__(self) -> CompiledScene:
        return self

    def __deepcopy__(self, memo: object) -> CompiledScene:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was compiled from."""
        return self.recipe


def compiled_scene(robot: Robot, spec: SceneSpec = NOTHING, arms: tuple[str, ...] | None = None) -> CompiledScene:
    """Return the scene of a robot at a table with objects; compiled once per process.

    Args:
        robot: one of `ROBOTS`.
        spec: scene contents besides robot and table.
        arms: names of the working arms, in the order of observations; None: the robot's first.

    Raises:
        BadOption: the robot has no such arm.
    """
    return _compiled(robot, spec, robot.checked_arms(arms))


@lru_cache(maxsize=KEPT)
def _compiled(robot: Robot, spec: SceneSpec, working: tuple[str, ...]) -> CompiledScene:
    with robosuite_library():
        from . import robosuite_model as library
    with decimal_points():
        env = library.table_env(robot.name, robot.gripper, spec, robot.place(working))
    model = env.sim.model._model
    objects = [_body_of(model, each.name) for each in spec.objects]
    furniture = [model.body(each.name).id for each in spec.furniture]
    known = {**{body: FIRST_OBJECT + k for k, body in enumerate(objects)}, **dict.fromkeys(furniture, FURNITURE)}
    recipe = compiled_scene, (robot, spec, working)
    return scene_of(env, robot, spec, working, np.array(objects, dtype=np.int64), known, recipe)


def scene_of(
    env: Any,
    robot: Robot,
    spec: SceneSpec,
    working: tuple[str, ...],
    objects: np.ndarray,
    known: dict[int, int],
    recipe: tuple[Callable[..., CompiledScene], tuple[Any, ...]],
) -> CompiledScene:
    """Return the scene of a robosuite environment, with the addresses of its parts.

    Args:
        env: robosuite's environment; its model is copied.
        robot: its robot.
        spec: scene contents that the environment was given: obstacles, beads and furniture by name.
        working: names of the working arms.
        objects: (n,) body ids of the free objects.
        known: owners by body id, of the bodies of objects, furniture and whatever else does not belong to the world.
        recipe: function and arguments that give this scene again.
    """
    model, rob = copy.copy(env.sim.model._model), env.robots[0]
    indices = {side: arm_index(model, rob, side, robot.speeds, robot.name) for side in rob.arms}
    idle = tuple(side for side in rob.arms if side not in working)
    furniture = np.array([model.body(each.name).id for each in spec.furniture], dtype=np.int64)
    bodies = [model.body(f"obstacle{k}").id for k in range(spec.obstacles)]
    obstacles = np.array([(body, *_geoms(model, body)) for body in bodies], dtype=np.int64).reshape(-1, 3)
    beads = [model.body(f"bead{k}").id for k in range(spec.beads.count)] if spec.beads else []
    joints = model.body_jntadr[np.array(beads, dtype=np.int64)]
    places = model.jnt_qposadr[joints[:, None] + np.arange(3)].astype(np.int64)
    known = {**known, **dict.fromkeys(beads, BEAD), **dict.fromkeys(bodies, OBSTACLE)}
    owner, labels = _owners(model, [indices[side] for side in (*working, *idle)], known)
    dof = len(robot.speeds)
    return CompiledScene(
        robot=robot,
        spec=spec,
        model=model,
        arms=tuple(indices[side] for side in working),
        home=np.array([robot.ready[side] for side in working]),
        parked=tuple(indices[side] for side in idle),
        parked_joints=np.array([robot.parked[side] for side in idle]).reshape(-1, dof),
        objects=objects,
        furniture=model.body_mocapid[furniture].astype(np.int64),
        obstacles=obstacles,
        beads=places,
        owner=owner,
        labels=labels,
        fixtures=static_shapes(model, np.flatnonzero(owner == WORLD)),
        recipe=recipe,
    )


def robot_arm(robot: Robot, index: int = 0) -> Arm:
    """Return the kinematics of a robot's arm at the table, tcp between the finger pads.

    Args:
        robot: one of `ROBOTS`.
        index: index among the arms that work by default.
    """
    return compiled_scene(robot).arms[index].arm


@contextmanager
def robosuite_library() -> Iterator[None]:
    """Let modules that use robosuite be imported in the `with` block, late: it takes seconds.

    robosuite warns of optional packages, imports libraries that draw, and sets MUJOCO_GL for this and all further
    processes.
    """
    before, backend = logging.root.manager.disable, os.environ.get("MUJOCO_GL")
    logging.disable(logging.WARNING)
    try:
        with deferred("PIL", "PIL.Image", "cv2", "mujoco.viewer"):
            yield
    finally:
        logging.disable(before)
        if backend is None:
            os.environ.pop("MUJOCO_GL", None)
        else:
            os.environ["MUJOCO_GL"] = backend


def _body_of(model: mujoco.MjModel, name: str) -> int:
    """Return the body id of an object; robosuite's own objects have a suffix in their name."""
    found = mujoco.mj_name2id(model, mujoco.mjtObj.mjOBJ_BODY, name)
    return found if found >= 0 else model.body(f"{name}_main").id


def _geoms(model: mujoco.MjModel, body: int) -> range:
    return range(model.body_geomadr[body], model.body_geomadr[body] + model.body_geomnum[body])


def _owners(
    model: mujoco.MjModel, arms: Iterable[ArmIndex], known: dict[int, int]
) -> tuple[np.ndarray, tuple[str, ...]]:
    """Return the owner of every geom, and its name for messages.

    Args:
        model: compiled model.
        arms: working arms, then idle ones.
        known: owners by body id, for bodies other than the robot's and the world's.
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
