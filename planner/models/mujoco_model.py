"""Compiled MuJoCo models, read by their named fields: joints, couplings, closed loops and geoms.

MuJoCo itself is not imported.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import BadModel
from ..geometry.pose import Pose
from .model_joints import OTHER, SLIDES, TURNS, Coupling, ModelJoint
from .model_report import SHOWN, listed

KINDS = {2: SLIDES, 3: TURNS}
"""mjJNT_SLIDE and mjJNT_HINGE."""
CONNECT, WELD, JOINT = 0, 1, 2
"""mjEQ_CONNECT, mjEQ_WELD and mjEQ_JOINT."""
SITE = 6
"""mjOBJ_SITE."""
TERMS = 5
"""Number of coefficients of a joint equality."""


class Loop(NamedTuple):
    """A constraint that ties two bodies together.

    Attributes:
        name: for messages.
        bodies: the two bodies.
        mocap: whether one of them is moved from outside: a target, not a part of the robot.
    """

    name: str
    bodies: tuple[int, int]
    mocap: bool


def mujoco_pose(position: np.ndarray, wxyz: np.ndarray) -> Pose:
    """Return the pose of a position and a quaternion of a MuJoCo model.

    Args:
        position: (3,) [m].
        wxyz: (4,) quaternion, normalized here.
    """
    return Pose.from_position_quaternion(position, wxyz / np.linalg.norm(wxyz))


def mujoco_id(model: Any, kind: str, name: str, source: str) -> int:
    """Return the index of a named element of a compiled model.

    Args:
        model: `mujoco.MjModel`.
        kind: "site" or "body".
        name: of the element.
        source: name of the model for messages.

    Raises:
        BadModel: the model lacks the element.
    """
    try:
        return int(getattr(model, kind)(name).id)
    except KeyError:
        names = [getattr(model, kind)(k).name for k in range(int(getattr(model, f"n{kind}")))]
        raise BadModel(source, f"{kind} {name!r}", f"not in the model; known: {listed(names, 3 * SHOWN)}") from None


def mujoco_bodies(model: Any, body: int) -> list[int]:
    """Return the bodies from the world (excluded) to a body (included).

    Args:
        model: `mujoco.MjModel`.
        body: index of the last body.
    """
    path = []
    while body != 0:
        path.append(body)
        body = int(model.body_parentid[body])
    return path[::-1]


def mujoco_body_names(model: Any) -> list[str]:
    """Return the names of all bodies; those without are told apart by their index."""
    return [model.body(k).name or f"(body {k}, without a name)" for k in range(int(model.nbody))]


def mujoco_joint_names(model: Any) -> list[str]:
    """Return the names of all joints; those without are named after their body, and told apart by their index."""
    bodies = mujoco_body_names(model)
    owners = [bodies[int(body)] for body in model.jnt_bodyid]
    return [model.joint(k).name or f"(joint {k}, of {body}, without a name)" for k, body in enumerate(owners)]


def mujoco_joint_id(names: Sequence[str], name: str, source: str) -> int:
    """Return the index of a joint.

    Args:
        names: of all joints, see `mujoco_joint_names`.
        name: of the joint.
        source: name of the model for messages.

    Raises:
        BadModel: the model lacks the joint.
    """
    if name not in names:
        raise BadModel(source, f"joint {name!r}", f"not in the model; joints: {listed(names, 3 * SHOWN)}")
    return names.index(name)


def mujoco_joint(model: Any, index: int, name: str) -> ModelJoint:
    """Return a joint.

    Args:
        model: `mujoco.MjModel`.
        index: of the joint.
        name: of the joint.
    """
    kind = KINDS.get(int(model.jnt_type[index]), OTHER)
    low, high = model.jnt_range[index] if model.jnt_limited[index] and kind != OTHER else (-np.inf, np.inf)
    rest = 0.0 if kind == OTHER else float(model.qpos0[model.jnt_qposadr[index]])
    return ModelJoint(name, kind, model.jnt_axis[index], model.jnt_pos[index], float(low), float(high), rest)


def mujoco_joints(model: Any) -> dict[str, ModelJoint]:
    """Return all joints by name."""
    return {name: mujoco_joint(model, k, name) for k, name in enumerate(mujoco_joint_names(model))}


def mujoco_couplings(model: Any) -> tuple[Coupling, ...]:
    """Return the joints that an active equality of joints makes follow others."""
    names, joints, found = mujoco_joint_names(model), mujoco_joints(model), []
    for k in _active(model):
        if int(model.eq_type[k]) != JOINT:
            continue
        follower, leader = names[int(model.eq_obj1id[k])], int(model.eq_obj2id[k])
        terms = np.trim_zeros(np.array(model.eq_data[k][:TERMS]), "b")
        terms = terms if leader >= 0 and len(terms) > 1 else np.array([float(model.eq_data[k][0])])
        start = joints[names[leader]].rest if len(terms) > 1 else 0.0
        shifted = Polynomial(terms)(Polynomial([-start, 1.0])) if len(terms) > 1 else Polynomial(terms)
        shifted = shifted + joints[follower].rest
        found.append(Coupling(follower, names[leader] if len(terms) > 1 else "", tuple(map(float, shifted.coef))))
    return tuple(found)


def mujoco_loops(model: Any) -> list[Loop]:
    """Return the active constraints that tie two bodies together."""
    loops, bodies = [], mujoco_body_names(model)
    for k in _active(model):
        if int(model.eq_type[k]) not in (CONNECT, WELD):
            continue
        ends = [int(model.eq_obj1id[k]), int(model.eq_obj2id[k])]
        if int(getattr(model, "eq_objtype", np.zeros(k + 1))[k]) == SITE:
            ends = [int(model.site_bodyid[end]) for end in ends]
        first, second = (max(end, 0) for end in ends)
        kind = "connect" if int(model.eq_type[k]) == CONNECT else "weld"
        names = " and ".join(bodies[end] for end in (first, second))
        mocap = bool((model.body_mocapid[[first, second]] >= 0).any())
        loops.append(Loop(f"<{kind}> of {names}", (first, second), mocap))
    return loops


def solid_geoms(model: Any, body: int) -> list[int]:
    """Return the geoms of a body that can collide.

    Args:
        model: `mujoco.MjModel`.
        body: index of the body.
    """
    return [geom for geom in geoms_of(model, body) if model.geom_contype[geom] or model.geom_conaffinity[geom]]


def geoms_of(model: Any, body: int) -> range:
    """Return all geoms of a body.

    Args:
        model: `mujoco.MjModel`.
        body: index of the body.
    """
    first = int(model.body_geomadr[body])
    return range(first, first + int(model.body_geomnum[body]))


def unused_of_mujoco(model: Any) -> Iterator[str]:
    """Yield a line for each kind of content that no reader uses."""
    others = [k for k in _active(model) if int(model.eq_type[k]) not in (CONNECT, WELD, JOINT)]
    if others:
        yield f"equalities of tendons or flexes: {len(others)}"
    if int(model.nexclude):
        yield f"pairs of bodies without contact (<exclude>): {int(model.nexclude)}"
    if int(model.npair):
        yield f"pairs of geoms with contact of their own (<pair>): {int(model.npair)}"
    if int(model.ntendon):
        yield f"tendons: {int(model.ntendon)}"
    if flexes := int(getattr(model, "nflex", 0)):
        yield f"flexes: {flexes}"


def _active(model: Any) -> list[int]:
    return [k for k in range(int(model.neq)) if bool(model.eq_active0[k])]
