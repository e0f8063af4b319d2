"""Features: the part of an observation that a learner sees, as a flat vector of named numbers.

Not in the paper: nothing is learned there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from gymnasium import spaces

from ...planner.errors import BadOption, UnknownName
from ..policy import Observation

RELATIVE = {
    "object_minus_tcp": ("object_pose", "tcp_pose"),
    "goal_minus_tcp": ("goal_pose", "tcp_pose"),
    "goal_minus_object": ("goal_pose", "object_pose"),
}
"""Blocks of differences: minuend and subtrahend entries."""
RAW = "raw:"
"""Prefix of blocks that take an entry's numbers unchanged."""
POSE, OBSTACLE = "_pose", "obstacle_"
AXES = ("x", "y", "z", "x_axis.x", "x_axis.y", "x_axis.z", "z_axis.x", "z_axis.y", "z_axis.z")
BETWEEN = ("x", "y", "z", "cos", "sin", "near_x", "near_y", "near_z")
"""Names of the numbers of a difference."""
NEAR = 0.02
"""Length scale [m] of the saturated differences in the last three numbers of `BETWEEN`."""
Shape = tuple[int, ...]


@dataclass(frozen=True, slots=True)
class Features:
    """Selection and order of the numbers of an observation that a learner sees.

    A block is one of:

    - the name of an observation entry. Poses (names that end in `_pose`) become nine numbers: position [m], and the
      frame's x and z axes in the world. These do not depend on the sign of the quaternion, and are continuous, which no
      four numbers are (Zhou et al., On the Continuity of Rotation Representations in Neural Networks, CVPR 2019). All
      other entries stay unchanged.
    - a name of `RELATIVE`: for each pair of poses the difference of the positions [m] in world axes; the cosine and
      sine of the angle between their x axes in the horizontal plane, each times the lengths of the two projected axes,
      so that nothing jumps where an axis is vertical; and tanh(difference / `NEAR`), because the differences that
      decide on success are tiny on the scale of a table. Goals and objects are paired in order if there are as many
      of each; otherwise every pose is paired with every other.
    - `raw:NAME`: an entry's numbers unchanged, as Stable-Baselines3's `MultiInputPolicy` takes them.

    Attributes:
        shapes: name and shape of every entry that the blocks need, sorted by name.
        blocks: the blocks, in order.

    Raises:
        UnknownName: a block is neither an entry nor a difference of entries.
        BadOption: a pose is not (n, 7), or a block occurs twice.
    """

    shapes: tuple[tuple[str, Shape], ...]
    blocks: tuple[str, ...]

    def __post_init__(self):
        table = dict(self.shapes)
        for block in self.blocks:
            if self.blocks.count(block) > 1:
                raise BadOption("features", f"{block} is there twice")
            for key in keys_of(block):
                if key not in table:
                    known = [*table, *(name for name, pair in RELATIVE.items() if set(pair) <= set(table))]
                    raise UnknownName("feature", block, known)
                if not block.startswith(RAW) and key.endswith(POSE) and table[key][1:] != (7,):
                    raise BadOption("features", f"{key} has shape {table[key]}; poses are (n, 7)")
        needed = {key for block in self.blocks for key in keys_of(block)}
        object.__setattr__(self, "shapes", tuple(sorted((key, table[key]) for key in needed)))

    @staticmethod
    def of(
        space: spaces.Space[Any], keys: tuple[str, ...] | None = None, *, obstacles: bool = False, relative: bool = True
    ) -> Features:
        """Return the features of an observation space.

        Args:
            space: Dict of boxes, as in this project's environments.
            keys: entries to include; None: all but the obstacles'.
            obstacles: include the obstacles' entries, too; only where `keys` is None.
            relative: include the differences of `RELATIVE` whose entries are included.

        Raises:
            BadOption: the space is not a Dict of boxes.
            UnknownName: the space lacks a key.
        """
        shapes = shapes_of(space)
        if keys is None:
            keys = tuple(key for key in shapes if obstacles or not key.startswith(OBSTACLE))
        pairs = tuple(name for name, pair in RELATIVE.items() if relative and set(pair) <= set(keys))
        return Features(tuple(shapes.items()), (*keys, *pairs))

    @staticmethod
    def raw(space: spaces.Space[Any]) -> Features:
        """Return the features that Stable-Baselines3's `MultiInputPolicy` takes: all entries, one after the other."""
        shapes = shapes_of(space)
        return Features(tuple(shapes.items()), tuple(f"{RAW}{key}" for key in shapes))

    @property
    def size(self) -> int:
        """Number of features."""
        return sum(self._size(block) for block in self.blocks)

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each feature, like `tcp_pose[0].z` or `goal_minus_object[1,1].cos`."""
        return tuple(name for block in self.blocks for name in self._names(block))

    def __call__(self, observation: Observation) -> np.ndarray:
        """Return the features (size,) float32 of an observation, or (..., size) of one with leading axes."""
        parts = [self._values(block, observation) for block in self.blocks]
        return np.concatenate(parts, axis=-1).astype(np.float32)

    def bounds(self, space: spaces.Space[Any]) -> tuple[np.ndarray, np.ndarray]:
        """Return the smallest and largest value (size,) of each feature, from the bounds of the space."""
        low, high = ({key: _box(space, key, end) for key, _ in self.shapes} for end in ("low", "high"))
        lowest = [self._bound(block, low, high, -1.0) for block in self.blocks]
        highest = [self._bound(block, high, low, 1.0) for block in self.blocks]
        return np.concatenate(lowest), np.concatenate(highest)

    def _size(self, block: str) -> int:
        shapes = dict(self.shapes)
        if block in RELATIVE:
            return len(BETWEEN) * (shapes[RELATIVE[block][0]][0] if self._paired(block) else self._pairs(block))
        if _is_pose(block):
            return len(AXES) * shapes[block][0]
        return math.prod(shapes[block.removeprefix(RAW)])

    def _pairs(self, block: str) -> int:
        shapes = dict(self.shapes)
        return shapes[RELATIVE[block][0]][0] * shapes[RELATIVE[block][1]][0]

    def _paired(self, block: str) -> bool:
        shapes = dict(self.shapes)
        return block == "goal_minus_object" and shapes["goal_pose"] == shapes["object_pose"]

    def _names(self, block: str) -> Iterator[str]:
        shapes = dict(self.shapes)
        if block in RELATIVE:
            first, second = (range(shapes[key][0]) for key in RELATIVE[block])
            pairs = zip(first, second, strict=True) if self._paired(block) else ((a, b) for a in first for b in second)
            yield from (f"{block}[{a},{b}].{end}" for a, b in pairs for end in BETWEEN)
        elif _is_pose(block):
            yield from (f"{block}[{k}].{end}" for k in range(shapes[block][0]) for end in AXES)
        else:
            for index in np.ndindex(shapes[block.removeprefix(RAW)]):
                yield f"{block}[{','.join(map(str, index))}]"

    def _values(self, block: str, observation: Observation) -> np.ndarray:
        if block in RELATIVE:
            of, less = (observation[key] for key in RELATIVE[block])
            return _flat(_between(of, less, self._paired(block)), 2 if self._paired(block) else 3)
        if _is_pose(block):
            poses = observation[block]
            return _flat(np.concatenate([poses[..., :3], _axis(poses, 0), _axis(poses, 2)], axis=-1), 2)
        key = block.removeprefix(RAW)
        return _flat(np.asarray(observation[key], dtype=np.float64), len(dict(self.shapes)[key]))

    def _bound(
        self, block: str, near: Mapping[str, np.ndarray], far: Mapping[str, np.ndarray], unit: float
    ) -> np.ndarray:
        """Return a block's bound on the side of `unit`, from the entries' bounds on this side and the far side."""
        if block in RELATIVE:
            of, less = (bounds[key][:, :3] for bounds, key in zip((near, far), RELATIVE[block], strict=True))
            gap = of - less if self._paired(block) else (of[:, None] - less[None]).reshape(-1, 3)
            return np.column_stack([gap, np.full((len(gap), len(BETWEEN) - 3), unit)]).ravel()
        if _is_pose(block):
            places = near[block][:, :3]
            return np.column_stack([places, np.full((len(places), 6), unit)]).ravel()
        return near[block.removeprefix(RAW)].ravel()


def keys_of(block: str) -> tuple[str, ...]:
    """Return the observation entries that a block is made of."""
    return RELATIVE.get(block) or (block.removeprefix(RAW),)


def shapes_of(space: spaces.Space[Any]) -> dict[str, Shape]:
    """Return the shapes of the entries of an observation space, by name.

    Raises:
        BadOption: the space is not a Dict of boxes.
    """
    if not isinstance(space, spaces.Dict):
        raise BadOption("observation_space", f"is a {type(space).__name__}, not a Dict of boxes")
    for key, entry in space.spaces.items():
        if not isinstance(entry, spaces.Box):
            raise BadOption("observation_space", f"{key} is a {type(entry).__name__}, not a Box")
    return {key: tuple(entry.shape or ()) for key, entry in space.spaces.items()}


def _box(space: Any, key: str, end: str) -> np.ndarray:
    return np.asarray(getattr(space[key], end), dtype=np.float64)


def _is_pose(block: str) -> bool:
    return block.endswith(POSE) and not block.startswith(RAW)


def _flat(values: np.ndarray, axes: int) -> np.ndarray:
    """Merge the last axes into one."""
    return values.reshape(*values.shape[: values.ndim - axes], -1)


def _axis(poses: np.ndarray, axis: int) -> np.ndarray:
    """Return the x or z axis (..., 3) of the frames of poses (..., 7) in the world: a column of the rotation matrix."""
    w, x, y, z = (poses[..., k] for k in range(3, 7))
    if axis == 0:
        return np.stack([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + w * z), 2.0 * (x * z - w * y)], axis=-1)
    return np.stack([2.0 * (x * z + w * y), 2.0 * (y * z - w * x), 1.0 - 2.0 * (x * x + y * y)], axis=-1)


def _between(of: np.ndarray, less: np.ndarray, paired: bool) -> np.ndarray:
    """Return the differences (..., n, 8) of poses in order, or (..., n, m, 8) of every pair; see `Features`."""
    if not paired:
        of, less = of[..., :, None, :], less[..., None, :, :]
    to, start = _axis(of, 0), _axis(less, 0)
    cos = to[..., 0] * start[..., 0] + to[..., 1] * start[..., 1]
    sin = start[..., 0] * to[..., 1] - start[..., 1] * to[..., 0]
    gap = of[..., :3] - less[..., :3]
    return np.concatenate([gap, cos[..., None], sin[..., None], np.tanh(gap / NEAR)], axis=-1)
