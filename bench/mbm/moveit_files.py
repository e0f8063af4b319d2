"""Archives of MotionBenchMaker: MoveIt's messages as YAML, a scene and a request per problem.

A member is `…/<scene>_<robot>/scene0001.yaml` or `request0001.yaml`. A scene's `world.collision_objects` have boxes,
cylinders (height, radius) and spheres with poses of their own in the frame of their object; quaternions are xyzw. A
request has `start_state.joint_state` of all joints and `goal_constraints[0].joint_constraints` of those that move.
"""

from __future__ import annotations

import lzma
import math
import re
import tarfile
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig
from ...planner import Obstacle, Pose
from ...planner.errors import OneDemoError
from .problems import Problem, primitive

MEMBER = re.compile(r"(?:.*/)?([^/]+)_([^/_]+)/(scene|request)(\d+)\.yaml")
SIZES = {"box": (0, 1, 2), "cylinder": (1, 0), "sphere": (0,)}
"""Places of `dimensions` in the order of `primitive`: MoveIt names the height of a cylinder first."""


def read_archive(path: Path) -> list[Problem]:
    """Read an archive of one robot's problems, by scene and number.

    Args:
        path: a tar archive, compressed or not.

    Raises:
        BadConfig: no such file, no archive, no problem in it, or a message that is not understood.
    """
    scenes: dict[tuple[str, int], dict[str, Any]] = {}
    requests: dict[tuple[str, int], dict[str, Any]] = {}
    for name, kind, number, message in _messages(path):
        (scenes if kind == "scene" else requests)[name, number] = message
    if not requests:
        raise BadConfig(path, "members", "none is named <scene>_<robot>/request<number>.yaml")
    if lonely := sorted(set(scenes) ^ set(requests)):
        raise BadConfig(path, "{} {}".format(*lonely[0]), "has a scene or a request, not both")
    return [_problem(path, key, scenes[key], requests[key]) for key in sorted(requests)]


def _messages(path: Path) -> Iterator[tuple[str, str, int, dict[str, Any]]]:
    from ruamel.yaml import YAML
    from ruamel.yaml.error import YAMLError

    reader = YAML(typ="safe", pure=True)
    try:
        with tarfile.open(path) as archive:
            for member in archive:
                found = MEMBER.fullmatch(member.name)
                file = archive.extractfile(member) if found and member.isfile() else None
                if found and file is not None:
                    try:
                        message = reader.load(file.read().decode())
                    except (YAMLError, ValueError) as error:
                        raise BadConfig(path, member.name, " ".join(str(error).split())) from None
                    yield found[1], found[3], int(found[4]), message
    except (OSError, tarfile.TarError, EOFError, lzma.LZMAError, zlib.error) as error:
        reason = getattr(error, "strerror", None) or " ".join(str(error).split())
        raise BadConfig(path, "archive", reason) from None


def _problem(path: Path, key: tuple[str, int], scene: dict[str, Any], request: dict[str, Any]) -> Problem:
    where = "{} {}".format(*key)
    try:
        objects = scene["world"]["collision_objects"] or []
        obstacles = tuple(obstacle for each in objects for obstacle in _obstacles(each))
        if (scene.get("robot_state") or {}).get("attached_collision_objects"):
            raise BadConfig(path, where, "has attached objects, which are not read")
        octomap = scene["world"].get("octomap") or {}
        if (octomap.get("octomap") or octomap).get("data"):
            raise BadConfig(path, where, "has an octomap, which is not read")
        state = request["start_state"]["joint_state"]
        start = dict(zip(state["name"], map(float, state["position"]), strict=True))
        constraints = request["goal_constraints"][0]["joint_constraints"]
        goal = {each["joint_name"]: float(each["position"]) for each in constraints}
    except OneDemoError as error:
        raise error if isinstance(error, BadConfig) else BadConfig(path, where, str(error)) from None
    except (KeyError, IndexError, TypeError, ValueError, AttributeError) as error:
        what = f"{type(error).__name__} at {error}"
        raise BadConfig(path, where, f"is no scene and request of MoveIt ({what})") from None
    for name, value in (*start.items(), *goal.items()):
        if not math.isfinite(value):
            raise BadConfig(path, where, f"{name} stands at {value}")
    return Problem(*key, obstacles, start, goal)


def _obstacles(message: dict[str, Any]) -> Iterator[Obstacle]:
    """Yield the primitives of a collision object, with its name."""
    name = str(message["id"])
    if message.get("meshes") or message.get("planes"):
        raise BadConfig("problems", name, "has a mesh or a plane; read are boxes, cylinders and spheres")
    world_from_object = _pose(message["pose"]) if message.get("pose") else Pose.identity()
    for each, placed in zip(message["primitives"], message["primitive_poses"], strict=True):
        kind, sizes = str(each["type"]), each["dimensions"]
        order = SIZES.get(kind, ())
        order = order if len(order) == len(sizes) else range(len(sizes))
        shape = primitive(kind, [float(sizes[place]) for place in order], name)
        yield Obstacle(shape, world_from_object @ _pose(placed), name=name)


def _pose(message: dict[str, Any]) -> Pose:
    x, y, z, w = map(float, message["orientation"])
    quaternion = np.array([w, x, y, z])
    length = np.linalg.norm(quaternion)
    if not length > 0.0:
        raise ValueError(f"orientation {message['orientation']}")
    return Pose.from_position_quaternion(message["position"], quaternion / length)
