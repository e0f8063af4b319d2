"""Compiled scenes, and where everything is in MuJoCo's arrays."""

from __future__ import annotations

import copy
import logging
from dataclasses import dataclass
from functools import lru_cache
from importlib import import_module
from typing import Any

import mujoco
import numpy as np

from ..planner.arm import Arm
from ..planner.errors import UnknownName
from ..planner.pose import Pose
from ..planner.shapes import Box as BoxShape
from ..planner.shapes import Capsule, Cylinder, Obstacle, Shape, Sphere
from .things import NOTHING, Things

ROBOTS = {
    "Panda": (2.175, 2.175, 2.175, 2.175, 2.61, 2.61, 2.61),
}
"""The robots that are supported, with their joint speed limits [rad/s] (the maker's data sheet)."""
WORLD, ARM, FINGERS, OTHER_ARM, OTHER_FINGERS, OBSTACLE, FURNITURE, BEAD, FIRST_OBJECT = range(9)
"""Who a geom belongs to: what is fixed to the world, the first arm, its fingers, the second arm, its fingers, an
obstacle, furniture, a bead, or object k as FIRST_OBJECT + k."""


@dataclass(frozen=True)
class ArmIndex:
    """Where one arm and its gripper are in MuJoCo's arrays.

    Attributes:
        arm: its kinematics.
        qpos: (dof,) addresses of the joint positions.
        qvel: (dof,) addresses of the joint speeds.
        ctrl: (dof,) its actuators.
        act: (dof,) their integrator states.
        site: the tcp.
        pads: geoms of the left and right finger pad.
        finger_qpos: addresses of the finger joints.
        grip: actuators of the fingers.
        opened: their controls when open.
        closed: their controls when closed.
    """

    arm: Arm
    qpos: np.ndarray
    qvel: np.ndarray
    ctrl: np.ndarray
    act: np.ndarray
    site: int
    pads: tuple[int, int]
    finger_qpos: np.ndarray
    grip: np.ndarray
    opened: np.ndarray
    closed: np.ndarray


@dataclass(frozen=True)
class Scene:
    """A compiled scene; `model` is shared: copy it before changing it.

    Attributes:
        model: MuJoCo's model.
        arms: the arms.
        home: (n_arms, dof) the robot's usual joints.
        objects: body ids of the free objects.
        furniture: mocap ids of the furniture.
        obstacles: (n, 3) body, solid geom and visible geom of each obstacle.
        beads: (n, 3) addresses of the beads' places in `qpos`.
        owner: (ngeom,) whose geom it is, see WORLD.
        labels: (ngeom,) names for messages.
        fixtures: what stands still for ever and is solid, the robot's own base and the floor left out.
    """

    model: mujoco.MjModel
    arms: tuple[ArmIndex, ...]
    home: np.ndarray
    objects: np.ndarray
    furniture: np.ndarray
    obstacles: np.ndarray
    beads: np.ndarray
    owner: np.ndarray
    labels: tuple[str, ...]
    fixtures: tuple[Obstacle, ...]


@lru_cache(maxsize=8)
def compiled_scene(robot: str, things: Things = NOTHING) -> Scene:
    """The scene of a robot at a table with things; compiled once per process.

    Raises:
        UnknownName: no such robot.
    """
    if robot not in ROBOTS:
        raise UnknownName("robot", robot, ROBOTS)
    env = _model_library().table_env(robot, things)
    model = copy.copy(env.sim.model._model)
    rob = env.robots[0]
    arms = tuple(_arm_index(model, env, robot, side) for side in rob.arms)
    home = np.array(rob.init_qpos, dtype=np.float64).reshape(len(arms), -1)
    objects = np.array([_body_of(model, each.name) for each in things.objects], dtype=np.int64)
    furniture = np.array([model.body(each.name).id for each in things.furniture], dtype=np.int64)
    bodies = [model.body(f"obstacle{k}").id for k in range(things.obstacles)]
    obstacles = np.array([(body, *_geoms(model, body)) for body in bodies], dtype=np.int64).reshape(-1, 3)
    beads = [model.body(f"bead{k}").id for k in range(things.beads.count)] if things.beads else []
    joints = model.body_jntadr[np.array(beads, dtype=np.int64)]
    places = model.jnt_qposadr[joints[:, None] + np.arange(3)].astype(np.int64)
    known = {**{int(body): FIRST_OBJECT + k for k, body in enumerate(objects)}, **dict.fromkeys(beads, BEAD)}
    known |= {**{int(body): FURNITURE for body in furniture}, **dict.fromkeys(bodies, OBSTACLE)}
    owner, labels = _owners(model, env, known)
    still = _fixtures(model, owner)
    mocap = model.body_mocapid[furniture].astype(np.int64)
    return Scene(model, arms, home, objects, mocap, obstacles, places, owner, labels, still)


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


def _arm_index(model: mujoco.MjModel, env, robot: str, side: str) -> ArmIndex:
    rob = env.robots[0]
    gripper = rob.gripper[side]
    count = len(rob.robot_joints) // len(rob.arms)
    first = rob.arms.index(side) * count
    names = rob.robot_joints[first : first + count]
    site = gripper.important_sites["grip_site"]
    arm = Arm.from_mujoco(model, names, site=site, velocity_limits=ROBOTS[robot], name=robot)
    joints = np.array([model.joint(name).id for name in names])
    ctrl = np.array([int(np.flatnonzero(model.actuator_trnid[:, 0] == joint)[0]) for joint in joints])
    grip = np.array([model.actuator(name).id for name in gripper.actuators])
    opened, closed = _gripper_controls(model, gripper, grip)
    pads = (gripper.important_geoms["left_fingerpad"], gripper.important_geoms["right_fingerpad"])
    return ArmIndex(
        arm=arm,
        qpos=model.jnt_qposadr[joints],
        qvel=model.jnt_dofadr[joints],
        ctrl=ctrl,
        act=model.actuator_actadr[ctrl],
        site=model.site(site).id,
        pads=(model.geom(pads[0][0]).id, model.geom(pads[1][0]).id),
        finger_qpos=np.array([model.joint(name).qposadr[0] for name in gripper.joints]),
        grip=grip,
        opened=opened,
        closed=closed,
    )


def _gripper_controls(model: mujoco.MjModel, gripper, grip: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Controls of the fingers when open and when closed, from the way robosuite drives that gripper."""
    low, high = model.actuator_ctrlrange[grip].T
    ends = []
    for direction in (-1.0, 1.0):
        for _ in range(100):  # robosuite's grippers move their command by a small step per call
            normalized = gripper.format_action(np.array([direction]))
        ends.append(low + 0.5 * (np.asarray(normalized) + 1.0) * (high - low))
    return ends[0], ends[1]


def _owners(model: mujoco.MjModel, env, known: dict[int, int]) -> tuple[np.ndarray, tuple[str, ...]]:
    """Of every geom its owner and its name for messages; `known` are the owners of bodies that are things."""
    rob = env.robots[0]
    fingers = set()
    for side in rob.arms:
        geoms = rob.gripper[side].important_geoms
        fingers |= {model.geom(name).id for key in ("left_finger", "right_finger") for name in geoms[key]}
    owner, labels = np.zeros(model.ngeom, dtype=np.int64), []
    for geom in range(model.ngeom):
        body = int(model.geom_bodyid[geom])
        name = model.body(body).name
        if body in known:
            owner[geom] = known[body]
            labels.append(name.removesuffix("_main"))
        elif geom in fingers:
            owner[geom] = FINGERS
            labels.append("fingers")
        elif name.startswith(("robot", "gripper")):
            owner[geom] = ARM
            labels.append(name.split("_", 1)[1])
        else:
            labels.append("table" if "table" in name else name or "world")
    return owner, tuple(labels)


def _fixtures(model: mujoco.MjModel, owner: np.ndarray) -> tuple[Obstacle, ...]:
    """The solid, unmoving geoms of a model that belong to nobody, as shapes in the world."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    found = []
    for geom in np.flatnonzero(owner == WORLD):
        solid = model.geom_contype[geom] or model.geom_conaffinity[geom]
        shape = _shape_of(int(model.geom_type[geom]), *model.geom_size[geom])
        if solid and shape is not None and model.body_weldid[model.geom_bodyid[geom]] == 0:
            matrix = np.eye(4)
            matrix[:3, :3], matrix[:3, 3] = data.geom_xmat[geom].reshape(3, 3), data.geom_xpos[geom]
            found.append(Obstacle(shape, Pose.from_matrix(matrix), name=model.body(model.geom_bodyid[geom]).name))
    return tuple(found)


def _shape_of(kind: int, x: float, y: float, z: float) -> Shape | None:
    """The shape of a geom by MuJoCo's half sizes; None for planes and meshes."""
    known = mujoco.mjtGeom
    if kind == known.mjGEOM_BOX:
        return BoxShape((2.0 * x, 2.0 * y, 2.0 * z))
    if kind == known.mjGEOM_CYLINDER:
        return Cylinder(x, 2.0 * y)
    if kind == known.mjGEOM_SPHERE:
        return Sphere(x)
    return Capsule(x, 2.0 * y) if kind == known.mjGEOM_CAPSULE else None
