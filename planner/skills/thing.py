"""Things of a scene: bodies of convex solids, their distances, their size and the heights they reach."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import cached_property

import fcl
import numpy as np

from ..geometry.hulls import corner_points
from ..geometry.pose import Pose
from ..geometry.shapes import Obstacle

UNIT = 1e4
"""fcl works in tenths of millimeters: it stops at an absolute tolerance."""


@dataclass(frozen=True, eq=False)
class Thing:
    """A body of one or several convex solids.

    Attributes:
        name: unique in its scene.
        parts: its solids, placed in its frame.
        free: whether it can be moved about; False for what is fixed or hinged.
    """

    name: str
    parts: tuple[Obstacle, ...]
    free: bool = True

    @cached_property
    def points(self) -> np.ndarray:
        """Corners (n, 3) [m] of all solids in the thing's frame; their hull contains it."""
        return np.vstack([_placed(part) for part in self.parts])

    @cached_property
    def middle(self) -> np.ndarray:
        """Middle (3,) [m] of the box about the thing, along the axes of its frame."""
        return 0.5 * (self.points.min(axis=0) + self.points.max(axis=0))

    @cached_property
    def volume(self) -> float:
        """Volume [m3] of the hull of all solids."""
        from scipy.spatial import ConvexHull

        return float(ConvexHull(self.points).volume)

    @cached_property
    def _solids(self) -> tuple[fcl.Convex, ...]:
        return tuple(_convex(_placed(part)) for part in self.parts)

    def corners_at(self, pose: Pose) -> np.ndarray:
        """Return the corners (n, 3) [m] in the world, for a pose of the thing."""
        return self.points @ pose.rotation.T + pose.position

    def lowest(self, pose: Pose) -> float:
        """Return the height (z) [m] of the lowest point, for a pose of the thing."""
        return float(self.corners_at(pose)[:, 2].min())

    def distance(self, pose: Pose, other: Thing, other_pose: Pose) -> float:
        """Return the distance [m] from another thing; 0 where they overlap.

        Args:
            pose: of this thing in the world.
            other: the other thing.
            other_pose: its pose in the world.
        """
        request = fcl.DistanceRequest(enable_nearest_points=False)
        mine = [_object(solid, pose) for solid in self._solids]
        others = [_object(solid, other_pose) for solid in other._solids]
        found = (fcl.distance(a, b, request, fcl.DistanceResult()) for a in mine for b in others)
        return max(0.0, min(found)) / UNIT


def touching(
    thing: Thing, pose: Pose, others: Iterable[tuple[Thing, Pose]], within: float
) -> list[tuple[Thing, float]]:
    """Return the things within a distance of one, with their distances [m], the smallest thing first.

    Args:
        thing: the thing.
        pose: its pose in the world.
        others: other things and their poses.
        within: largest distance [m].
    """
    gaps = [(other, thing.distance(pose, other, at)) for other, at in others]
    return sorted([(other, gap) for other, gap in gaps if gap <= within], key=lambda found: found[0].volume)


def thing_of(name: str, shape: object, free: bool = True) -> Thing:
    """Return a thing of one solid that is centered on its frame.

    Args:
        name: of the thing.
        shape: its solid.
        free: see `Thing`.
    """
    return Thing(name, (Obstacle(shape),), free)  # type: ignore[arg-type]


def by_name(things: Sequence[Thing]) -> dict[str, Thing]:
    """Return things by their names."""
    return {thing.name: thing for thing in things}


def _placed(part: Obstacle) -> np.ndarray:
    """Return corners (n, 3) of a solid in the frame it is placed in."""
    return corner_points(part.shape) @ part.pose.rotation.T + part.pose.position


def _convex(points: np.ndarray) -> fcl.Convex:
    from scipy.spatial import ConvexHull

    hull = ConvexHull(points)
    order = {int(vertex): k for k, vertex in enumerate(hull.vertices)}
    faces = np.concatenate([[3, *(order[int(vertex)] for vertex in face)] for face in _outward(hull)])
    return fcl.Convex(UNIT * points[hull.vertices], len(hull.simplices), faces)


def _outward(hull: object) -> np.ndarray:
    """Return the triangles (n, 3) of a hull, their corners counterclockwise seen from outside."""
    corners = hull.points[hull.simplices]  # type: ignore[attr-defined]
    turned = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    inwards = np.einsum("ij,ij->i", turned, hull.equations[:, :3]) < 0.0  # type: ignore[attr-defined]
    triangles = hull.simplices.copy()  # type: ignore[attr-defined]
    triangles[inwards] = triangles[inwards][:, ::-1]
    return triangles


def _object(solid: fcl.Convex, pose: Pose) -> fcl.CollisionObject:
    return fcl.CollisionObject(solid, fcl.Transform(pose.rotation, UNIT * pose.position))
