"""Scenes of robosuite's tasks: compiled once, with what moves and what stands in them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from ...planner.errors import BadOption
from ..core.description import TaskFurniture, TaskObject
from ..core.environment import SLOTS
from ..mujoco_library import decimal_points, mujoco
from ..scene.robots import ROBOTS, robot_named, robot_with_gripper
from ..scene.scene import ARM, FIRST_OBJECT, FURNITURE, KEPT, OTHER_ARM, CompiledScene, robosuite_library, scene_of
from ..scene.scene_objects import TABLE_HALF_SIZE, TABLE_HEIGHT, SceneSpec
from .judge import RobosuiteJudge
from .solids import body_solids, hull_of, solid_geoms

HAND = OTHER_ARM
"""Owner of the hand without its fingers, which may touch more than the links: there is no other arm."""
TABLE, FLOOR_BODY = "table", 0
FREE = int(mujoco.mjtJoint.mjJNT_FREE)


@dataclass(frozen=True, eq=False)
class GuestScene:
    """A compiled scene of a robosuite task; copies are the scene itself.

    Attributes:
        task: robosuite's name of the task.
        gripper: robosuite's name of the gripper.
        scene: the scene.
        env: robosuite's environment, which draws layouts.
        judge: its judge.
        objects: movable objects, those that never take part excluded.
        hidden: (n,) addresses of the free joints of the others in `qpos`.
        furniture: fixtures other than the table.
        joints: names of the scene's joints.
        joint_ranges: (n, 2) limits of these joints [rad or m].
        table_height: z of the table top, or of the floor of the bins [m].
        moved: (3,) displacement [m] of the robot's base from its place at OneDemo's table; None: it stands there.
        compartments: for each object that has one, the middle (3,) of the floor of its compartment in a bin [m].
    """

    task: str
    gripper: str
    scene: CompiledScene
    env: Any
    judge: RobosuiteJudge
    objects: tuple[TaskObject, ...]
    hidden: np.ndarray
    furniture: tuple[TaskFurniture, ...]
    joints: tuple[str, ...]
    joint_ranges: np.ndarray
    table_height: float
    moved: np.ndarray | None
    compartments: dict[str, np.ndarray]

    def __copy__(self) -> GuestScene:
        return self

    def __deepcopy__(self, memo: object) -> GuestScene:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle what it was compiled from."""
        return guest_scene, (self.task, self.scene.robot.name, self.gripper)


def check_guest(task: object) -> None:
    """Refuse what is no name of a robosuite task; nothing is compiled.

    Raises:
        UnknownName: robosuite has no such task for one arm.
        BadOption: the task cannot be made.
    """
    with robosuite_library():
        from . import robosuite_task
    robosuite_task.check_task(task)


def guest_scene(task: object, robot: object, gripper: object) -> GuestScene:
    """Return the scene of a robosuite task; compiled once per process.

    Args:
        task: robosuite's name of the task.
        robot: robosuite's name of the robot.
        gripper: robosuite's name of its gripper.

    Raises:
        UnknownName: there is no such task, robot or gripper.
        BadOption: the robot has two arms, or nothing in the task can be moved.
    """
    kind = robot_named(robot)
    if len(kind.ready) > 1:
        single = ", ".join(name for name, each in ROBOTS.items() if len(each.ready) == 1)
        raise BadOption("robot", f"{kind.name} has two arms; robosuite's tasks are for one: {single}")
    robot_with_gripper(robot, gripper)
    if not isinstance(task, str):
        task = repr(task)
    return _compiled(task, kind.name, str(gripper))


def _scene_alone(task: str, robot: str, gripper: str) -> CompiledScene:
    """Return the compiled scene within a task's scene, for pickles."""
    return guest_scene(task, robot, gripper).scene


@lru_cache(maxsize=KEPT)
def _compiled(task: str, robot: str, gripper: str) -> GuestScene:
    with robosuite_library():
        from . import robosuite_task
    with decimal_points():
        env = robosuite_task.task_env(task, robot, gripper, SLOTS)
    model, names = env.sim.model._model, {each.root_body: each.name for each in env.model.mujoco_objects}
    free = [body for body in range(model.nbody) if _is_free(model, body)]
    # where robosuite draws which object takes part, each of them may
    absent = set(env.cleared) if getattr(env, "single_object_mode", 0) != 1 else set()
    present = [body for body in free if _name(model, body, names) not in absent]
    objects = tuple(_object(model, body, _name(model, body, names)) for body in present)
    fixtures = [body for body in range(1, model.nbody) if _is_fixture(model, body, free)]
    furniture = tuple(_furniture(model, body) for body in fixtures)
    joints = [joint for joint in range(model.njnt) if _is_of_scene(model, joint)]
    if not objects and not joints:
        raise BadOption("task", f"{task} has neither an object nor a joint to move")
    owners = {body: FURNITURE for body in (*fixtures, *(each for body in free for each in _tree(model, body)))}
    owners |= {each: FIRST_OBJECT + k for k, body in enumerate(present) for each in _tree(model, body)}
    recipe = _scene_alone, (task, robot, gripper)
    kind = robot_with_gripper(robot, gripper)
    spec, bodies = SceneSpec(obstacles=SLOTS), np.array(present, dtype=np.int64)
    scene = scene_of(env, kind, spec, tuple(kind.ready), bodies, owners, recipe)
    addresses = model.jnt_qposadr[np.array(joints, dtype=np.int64)].astype(np.int64)
    return GuestScene(
        task=task,
        gripper=gripper,
        scene=replace(scene, owner=_with_hand(model, scene.owner)),
        env=env,
        judge=RobosuiteJudge(env, np.array(fixtures, dtype=np.int64), addresses),
        objects=objects,
        hidden=_addresses(model, [body for body in free if body not in present]),
        furniture=furniture,
        joints=tuple(model.joint(joint).name for joint in joints),
        joint_ranges=model.jnt_range[np.array(joints, dtype=np.int64)].copy(),
        table_height=float(np.asarray(_first(env, ("table_offset", "bin1_pos"), (0.0, 0.0, TABLE_HEIGHT)))[2]),
        moved=_moved_base(env, model, kind.stand),
        compartments=_compartments(env),
    )


def _is_free(model: mujoco.MjModel, body: int) -> bool:
    first = int(model.body_jntadr[body])
    return first >= 0 and int(model.jnt_type[first]) == FREE and not _is_robot(model, body)


def _is_robot(model: mujoco.MjModel, body: int) -> bool:
    """Return whether a body belongs to the robot, its gripper or its stand."""
    return model.body(int(model.body_rootid[body])).name.startswith(("robot", "gripper"))


def _is_fixture(model: mujoco.MjModel, body: int, free: list[int]) -> bool:
    """Return whether a body stands in the scene, or turns on one of its joints, and is solid or has solid parts."""
    if body == FLOOR_BODY or _is_robot(model, body) or int(model.body_rootid[body]) in free:
        return False
    whole = _tree(model, body) if model.body_parentid[body] == FLOOR_BODY else [body]
    return model.body(body).name != TABLE and model.body_mocapid[body] < 0 and bool(solid_geoms(model, whole))


def _is_of_scene(model: mujoco.MjModel, joint: int) -> bool:
    return int(model.jnt_type[joint]) != FREE and not _is_robot(model, int(model.jnt_bodyid[joint]))


def _tree(model: mujoco.MjModel, body: int) -> list[int]:
    """Return a body that stands in the world, or is free, and all that are attached to it."""
    return [int(each) for each in np.flatnonzero(model.body_rootid == body)]


def _name(model: mujoco.MjModel, body: int, names: dict[str, str]) -> str:
    name = str(model.body(body).name)
    return names.get(name, name.removesuffix("_main"))


def _object(model: mujoco.MjModel, body: int, name: str) -> TaskObject:
    parts = body_solids(model, body, solid_geoms(model, _tree(model, body)), name)
    return TaskObject(name, hull_of(parts), 2.0 * np.pi, parts)


def _furniture(model: mujoco.MjModel, body: int) -> TaskFurniture:
    name, root = (str(model.body(each).name).removesuffix("_main") for each in (body, int(model.body_rootid[body])))
    parts = body_solids(model, body, solid_geoms(model, [body]), name)
    return TaskFurniture(name, parts, "" if root == name else root)


def _with_hand(model: mujoco.MjModel, owner: np.ndarray) -> np.ndarray:
    """Return the owners of the geoms with the hand told apart from the links."""
    hand = [model.body(int(body)).name.startswith("gripper") for body in model.geom_bodyid]
    return np.where((owner == ARM) & np.array(hand), HAND, owner)


def _addresses(model: mujoco.MjModel, bodies: Iterable[int]) -> np.ndarray:
    joints = model.body_jntadr[np.array(list(bodies), dtype=np.int64)]
    return model.jnt_qposadr[joints].astype(np.int64)


def _first(env: Any, names: tuple[str, ...], otherwise: Any) -> Any:
    return next((getattr(env, name) for name in names if hasattr(env, name)), otherwise)


def _moved_base(env: Any, model: mujoco.MjModel, stand: float | None) -> np.ndarray | None:
    """Return how far the robot's base is from its place at OneDemo's table, where its capsules were fitted [m].

    None if it stands there.
    """
    robot = env.robots[0].robot_model
    usual = np.array(robot.base_xpos_offset["table"](2.0 * TABLE_HALF_SIZE), dtype=np.float64)
    if stand is not None:
        usual[0] = stand
    by = model.body(robot.root_body).pos + robot.bottom_offset - usual
    return by if np.abs(by).max() > 1e-6 else None


def _compartments(env: Any) -> dict[str, np.ndarray]:
    places = getattr(env, "target_bin_placements", None)
    if places is None:
        return {}
    return {each.name: np.array(place) for each, place in zip(env.objects, places, strict=True)}
