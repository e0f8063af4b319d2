"""Planning scenes: a YAML file in, the planner's objects out; every error names file and key."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..planner import Box, Capsule, Cylinder, Mesh, Obstacle, Pose, PosePath, Shape, Sphere, read_demonstration
from ..planner.errors import BadDemonstration, OneDemoError, UnfitShape, UnknownName
from ..planner.geometry.shapes import LARGEST
from ..planner.imitation.npz_arrays import unit_poses
from ..planner.imitation.segmentation import resampled
from .errors import BadConfig
from .plan_scene_schema import HeldItem, Placed, Recorded, SceneConfig, ShapeFields, checked
from .shipped_files import FOLDER, shipped_demonstration
from .strict_yaml import COMMAND_LINE, load_mapping, with_overrides, with_switches

STEP = 0.005
"""Path length [m] between poses of a demonstration, so that pauses have no weight."""
ANYWHERE = (0.0, 0.0, 0.0)
SWITCHES = ("robot.visuals",)
"""Keys that are true or false."""


@dataclass(frozen=True, slots=True)
class HeldObject:
    """An object in the hand.

    Attributes:
        name: name for messages and allowed pairs.
        shape: shape of the object.
        tcp_from_object: pose of the object in the tcp frame.
    """

    name: str
    shape: Shape
    tcp_from_object: Pose


@dataclass(frozen=True, slots=True, eq=False)
class PlanScene:
    """A motion to plan, without the arm, which only higher layers can build.

    Attributes:
        source: scene file.
        changed: first parts of the keys changed on the command line.
        config: contents of the file.
        demonstrated: demonstrated path in equal steps of path length.
        goal: goal pose of the tcp.
        obstacles: obstacles in the world.
        held: object in the hand, or None.
    """

    source: Path
    changed: frozenset[str]
    config: SceneConfig
    demonstrated: PosePath
    goal: Pose
    obstacles: tuple[Obstacle, ...]
    held: HeldObject | None

    @property
    def name(self) -> str:
        """File name without its suffix."""
        return self.source.stem

    @property
    def allowed(self) -> tuple[tuple[str, str], ...]:
        """Pairs (body part, obstacle) that may touch."""
        return tuple((mine, other) for mine, other in self.config.allowed)

    @contextmanager
    def blaming(self, key: str) -> Iterator[None]:
        """Make errors raised inside name the file, or the command line, and the key."""
        with _blaming(self.source, self.changed, key):
            yield

    def file(self, name: str) -> Path:
        """Return a file named in the scene: beside the scene file if it exists there, else the path as written."""
        return _beside(self.source, name)


def shipped_scene(name: str) -> Path:
    """Return the file of a shipped scene, like "sphere".

    Raises:
        UnknownName: no such scene; the message lists the known ones.
    """
    known = {path.stem: path for path in sorted((FOLDER / "scenes").glob("*.yaml"))}
    if name not in known:
        raise UnknownName("scene", name, known)
    return known[name]


def load_scene(path: str | Path, overrides: Sequence[str] = ()) -> PlanScene:
    """Load a scene file with `key=value` changes.

    Args:
        path: scene file.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: names the file, or the command line, and the key, and the allowed values.
    """
    source = Path(path)
    changed = frozenset(text.partition("=")[0].split(".")[0] for text in overrides)
    values = with_overrides(load_mapping(source), list(overrides))
    config = checked(with_switches(values, (text.partition("=")[0] for text in overrides), SWITCHES))
    if not isinstance(config, SceneConfig):
        key, reason = config
        raise BadConfig(_blamed(source, changed, key), key, reason)
    with _blaming(source, changed, "demonstration"):
        demonstrated = resampled(_demonstrated(source, config.demonstration), STEP)
    with _blaming(source, changed, "goal"):
        goal = _placed(config.goal) if isinstance(config.goal, Placed) else _pose(config.goal)
    obstacles = []
    for k, item in enumerate(config.obstacles):
        with _blaming(source, changed, f"obstacles[{k}]"):
            obstacles.append(Obstacle(_shape(item), _placed(item), np.array(item.velocity), item.name, item.margin))
    with _blaming(source, changed, "held"):
        held = None if config.held is None else _held(config.held)
    return PlanScene(source, changed, config, demonstrated, goal, tuple(obstacles), held)


def pose_of(placed: Placed) -> Pose:
    """Return the pose that a table describes."""
    return _placed(placed)


def _blamed(source: Path, changed: frozenset[str], key: str) -> str | Path:
    return COMMAND_LINE if key.partition(".")[0].partition("[")[0] in changed else source


@contextmanager
def _blaming(source: Path, changed: frozenset[str], key: str) -> Iterator[None]:
    try:
        yield
    except BadConfig:
        raise
    except BadDemonstration as error:
        own = f"{error.key}: {error.reason}"
        reason = f"{error.path}: {own}" if error.path else own
        raise BadConfig(_blamed(source, changed, key), key, reason) from None
    except OneDemoError as error:
        raise BadConfig(_blamed(source, changed, key), key, str(error)) from None


def _beside(source: Path, name: str) -> Path:
    beside = source.parent / name
    return beside if beside.exists() else Path(name)


def _demonstrated(source: Path, wanted: Recorded | list[list[float]]) -> PosePath:
    if not isinstance(wanted, Recorded):
        poses = unit_poses("", "poses", np.array(wanted))
        _near(poses[:, :3])
        return PosePath.from_vectors(poses)
    plain = Path(wanted.file).suffix == "" and len(Path(wanted.file).parts) == 1
    file = _beside(source, wanted.file)
    demonstration = read_demonstration(shipped_demonstration(wanted.file) if plain and not file.is_file() else file)
    return demonstration.path if wanted.segment is None else demonstration.segment_path(wanted.segment)


def _pose(vector: Sequence[float]) -> Pose:
    poses = unit_poses("", "pose", np.array([vector]))
    _near(poses[:, :3])
    return Pose.from_vector(poses[0])


def _near(positions: np.ndarray) -> np.ndarray:
    """Return the positions (..., 3) if they are plausible in meters."""
    farthest = float(np.abs(positions).max())
    if farthest > LARGEST:
        raise UnfitShape("pose", "position", f"{farthest:g} m away: millimetres?")
    return positions


def _placed(placed: Placed) -> Pose:
    if placed.quaternion is not None:
        return _pose([*placed.position, *placed.quaternion])
    at = _near(np.array(placed.position))
    roll, pitch, yaw = placed.rpy_degrees or (0.0, 0.0, placed.yaw_degrees or 0.0)
    turns = [_turn(2, yaw), _turn(1, pitch), _turn(0, roll)]
    return Pose.from_position_quaternion(at) @ turns[0] @ turns[1] @ turns[2]


def _turn(axis: int, degrees: float) -> Pose:
    half, quaternion = 0.5 * math.radians(degrees) if math.isfinite(degrees) else math.nan, np.zeros(4)
    quaternion[0], quaternion[axis + 1] = math.cos(half), math.sin(half)
    return Pose.from_position_quaternion(ANYWHERE, quaternion)


def _shape(item: ShapeFields) -> Shape:
    radius, length = item.radius or 0.0, item.length or 0.0
    if item.shape == "sphere":
        return Sphere(radius)
    if item.shape == "capsule":
        return Capsule(radius, length)
    if item.shape == "cylinder":
        return Cylinder(radius, length)
    if item.shape == "box":
        x, y, z = item.size or ANYWHERE
        return Box((x, y, z))
    return Mesh(np.array(item.vertices))


def _held(item: HeldItem) -> HeldObject:
    return HeldObject(item.name, _shape(item), _placed(item.tcp_from_object))
