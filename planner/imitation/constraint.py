"""Constraints of a carry as data: what of an object's motion a demonstration keeps, where, and within which bounds.

A carry has at most two stretches. In the first the object is *carried*: one or two components of its rotation against
gravity are kept, all else is free. In the second it is *guided*: it turns against gravity, or about a fixed axis, and
its pose relative to the goal is kept on the imitated path. Not in the paper, which keeps relative motions by imitation.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from ..arrays import checked_array, frozen
from ..errors import BadOption
from ..geometry.pose import Pose, PosePath
from ..ranges import check_count, check_range, check_ranges

Keeping = Literal["must", "prefer", "free"]
KEEPING = ("must", "prefer", "free")
"""How a constraint is kept: by every plan, or it fails; where a plan is found that keeps it; not at all."""
POSITION, ROTATION = 0.008, math.radians(5.0)
"""Tolerances [m], [rad] off the imitated path: an arm follows it to some millimeters, and corners are cut."""
MOST_DIRECTIONS = 100
"""Largest number of directions of a curve."""
UP = np.array([0.0, 0.0, 1.0])
"""Against gravity, in the world."""


@dataclass(frozen=True, slots=True)
class ConstraintSettings:
    """Tolerances of a constraint, beyond the demonstrated spread, and rules by which it is found.

    Attributes:
        angle: tolerance of rotations against gravity [rad].
        rotation: tolerance of rotations off the imitated path where the object is guided [rad].
        position: tolerance of positions off the imitated path where the object is guided [m].
        held: largest spread [rad] of what counts as held: hands tremble, and arms sag.
        least: smallest share of the path that something must be held for.
        slower: a stretch is held if it turns by less than this share of the rate at which the rest of the path turns.
        axis: largest displacement [m] of a point of an object that turns about a fixed axis.
    """

    angle: float = math.radians(5.0)
    rotation: float = ROTATION
    position: float = POSITION
    held: float = math.radians(10.0)
    least: float = 0.1
    slower: float = 0.25
    axis: float = 0.005

    def __post_init__(self):
        check_ranges(self, "(0, inf)", "angle", "rotation", "position", "axis")
        check_range("held", self.held, f"(0, {0.5 * math.pi}]")
        check_ranges(self, "[0, 1]", "least", "slower")


@dataclass(frozen=True, slots=True, eq=False)
class Constraint:
    """The part of an object's motion that is kept on a path of n poses.

    While the object is carried, the upward vertical as the object sees it stays within a bound of some directions: of a
    single one, if the object was held (two components of its rotation are kept, it stays upright), or of the curve that
    the vertical was shown to move along (one component is kept, the object turns as shown and no other way).

    Attributes:
        count: n.
        directions: (m, 3) unit, in the frame of the path's poses; (0, 3): nothing is kept while it is carried.
        spread: largest demonstrated angle from them [rad].
        bound: largest angle that still keeps it [rad].
        guided: index from which on the object is guided; n: nowhere.
        point: (3,) point whose position counts there [m], in the frame of the path's poses.
        position_bound: largest distance [m] of this point from its place on the imitated path.
        rotation_bound: largest angle [rad] off the imitated path.
    """

    count: int
    directions: np.ndarray = field(default_factory=lambda: np.empty((0, 3)))
    spread: float = 0.0
    bound: float = math.inf
    guided: int = -1
    point: np.ndarray = field(default_factory=lambda: np.zeros(3))
    position_bound: float = POSITION
    rotation_bound: float = ROTATION

    def __post_init__(self):
        check_count("count", self.count, "[1, inf)")
        for name, shape in (("directions", (None, 3)), ("point", (3,))):
            object.__setattr__(self, name, frozen(checked_array(name, getattr(self, name), shape)))
        lengths = np.linalg.norm(self.directions, axis=1)
        if (np.abs(lengths - 1.0) > 1e-6).any():
            k = int(np.abs(lengths - 1.0).argmax())
            raise BadOption(f"directions[{k}]", f"has length {lengths[k]:.3g}; must be 1")
        if len(self.directions) > MOST_DIRECTIONS:
            raise BadOption("directions", f"there are {len(self.directions)}; at most {MOST_DIRECTIONS}")
        check_ranges(self, "[0, inf)", "spread")
        check_ranges(self, "(0, inf]", "bound", "position_bound", "rotation_bound")
        if self.guided == -1:
            object.__setattr__(self, "guided", self.count)
        check_count("guided", self.guided, f"[0, {self.count}]")

    @property
    def components(self) -> int:
        """Number of components of the rotation that are kept while the object is carried: 0, 1 or 2."""
        return 0 if not len(self.directions) else 2 if len(self.directions) == 1 else 1

    @property
    def keeps_nothing(self) -> bool:
        """True if nothing is kept anywhere."""
        return not len(self.directions) and self.guided >= self.count

    @property
    def last_carried(self) -> int:
        """Index of the last pose that the object must be carried to: where it begins to be guided, or the end."""
        return min(self.guided, self.count - 1)

    def part(self, start: int, stop: int) -> Constraint:
        """Return the constraint of a part of the path.

        Args:
            start: index of its first pose.
            stop: index behind its last pose.
        """
        count = min(stop, self.count) - start
        return replace(self, count=count, guided=min(max(self.guided - start, 0), count))

    def ending(self, count: int) -> Constraint:
        """Return the constraint of another path of a number of poses that ends with the last poses of this one."""
        return replace(self, count=count, guided=max(0, count - (self.count - self.guided)))

    def of_lengths(self, before: np.ndarray, after: np.ndarray) -> Constraint:
        """Return the constraint of the same path with other poses.

        Args:
            before: (n,) path lengths [m] of the poses so far.
            after: (m,) path lengths of the new ones.
        """
        count = len(after)
        if count == self.count:
            return self
        if self.guided >= self.count:
            return replace(self, count=count, guided=count)
        share = before[self.guided] / max(before[-1], 1e-12)
        return replace(self, count=count, guided=int(np.searchsorted(after, share * after[-1] - 1e-12, side="left")))

    def with_tool(self, tcp_from_other: Pose) -> Constraint:
        """Return the same constraint for poses of another frame that moves along, see `PosePath.with_tool`."""
        back = tcp_from_other.inverse()
        return replace(
            self,
            directions=self.directions @ back.rotation.T,
            point=back.rotation @ self.point + back.position,
        )

    def deviations(self, path: PosePath) -> np.ndarray:
        """Return the angles (n,) [rad] of the vertical from what is kept while the object is carried; 0 if nothing is.

        Args:
            path: n poses.
        """
        if not len(self.directions):
            return np.zeros(len(path))
        seen = seen_up(path)
        return np.min([_angles_to_arc(seen, *arc) for arc in arcs(self.directions)], axis=0)


def arcs(directions: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Yield the ends of the arcs between neighbors (m, 3); of a single direction, it twice."""
    yield from zip(directions, directions[1:] if len(directions) > 1 else directions, strict=False)


def _angles_to_arc(vectors: np.ndarray, first: np.ndarray, last: np.ndarray) -> np.ndarray:
    """Return the angles (n,) [rad] of unit vectors (n, 3) to the nearest point of the chord between two directions."""
    along = last - first
    share = np.clip((vectors - first) @ along / max(float(along @ along), 1e-300), 0.0, 1.0)
    near = first + share[:, None] * along
    return angles_to(vectors, near / np.linalg.norm(near, axis=1, keepdims=True))


def seen_up(path: PosePath) -> np.ndarray:
    """Return the upward vertical in the frame of every pose (n, 3)."""
    return rotated(path, UP, inverse=True)


def rotated(path: PosePath, vector: np.ndarray, *, inverse: bool = False) -> np.ndarray:
    """Return a vector of the poses' frame in the world's axes at every pose (n, 3).

    Args:
        path: n poses.
        vector: (3,).
        inverse: True: a vector of the world in the axes of every pose.
    """
    w, turn = path.quaternions[:, :1], path.quaternions[:, 1:] * (-1.0 if inverse else 1.0)
    cross = np.cross(turn, vector)
    return vector + 2.0 * (w * cross + np.cross(turn, cross))


def angles_to(vectors: np.ndarray, axes: np.ndarray) -> np.ndarray:
    """Return the angles (n,) [rad] of unit vectors (n, 3) to unit vectors.

    Args:
        vectors: (n, 3).
        axes: (3,) or (n, 3).
    """
    return np.arctan2(np.linalg.norm(np.cross(vectors, axes), axis=-1), (vectors * axes).sum(axis=-1))
