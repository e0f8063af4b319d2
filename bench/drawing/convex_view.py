"""Orthographic views of convex solids: occlusion, painting order, outlines, and choice of the best view.

The projection is orthographic so that lengths are comparable and every outline is a convex polygon.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...planner import Box, Capsule, Cylinder, Mesh, Pose, Shape, Sphere
from ...planner.geometry.hulls import corner_points

CIRCLE = np.stack([np.cos(np.linspace(0, 2 * np.pi, 49)[:-1]), np.sin(np.linspace(0, 2 * np.pi, 49)[:-1])], axis=1)
"""(48, 2) points of the unit circle."""
RIM = 48
"""Corners of a cylinder's rim."""
AZIMUTHS, ELEVATIONS = tuple(90 * k + a for k in range(-2, 2) for a in (25, 35, 45, 55, 65)), (18, 26, 36)
"""Candidate directions [degrees]: none along an axis, where space looks flat."""
CELLS = 420
"""Number of cells, along the longer side, of the grid on which areas are united."""


@dataclass(frozen=True)
class DrawingView:
    """An orthographic view.

    Attributes:
        azimuth: azimuth of the viewer about z [degrees].
        elevation: elevation of the viewer [degrees].
    """

    azimuth: float
    elevation: float

    @property
    def axes(self) -> np.ndarray:
        """(3, 3) unit vectors as rows: right, up, and towards the viewer."""
        a, e = math.radians(self.azimuth), math.radians(self.elevation)
        right = [-math.sin(a), math.cos(a), 0.0]
        up = [-math.sin(e) * math.cos(a), -math.sin(e) * math.sin(a), math.cos(e)]
        return np.array([right, up, np.cross(right, up)])

    def flat(self, points: np.ndarray) -> np.ndarray:
        """Return the image coordinates (..., 2) of points (..., 3) [m]."""
        return np.asarray(points) @ self.axes[:2].T

    def depth(self, points: np.ndarray) -> np.ndarray:
        """Return the coordinates (...) of points (..., 3) towards the viewer [m]; larger is nearer."""
        return np.asarray(points) @ self.axes[2]


class Facet(NamedTuple):
    """A flat face of a surface: corners (k, 3) in order [m], and the outward unit normal (3,)."""

    corners: np.ndarray
    normal: np.ndarray


@dataclass(frozen=True, eq=False)
class ConvexSolid:
    """A convex solid: all points within `radius` of the convex hull of `core`.

    Attributes:
        core: (n, 3) corners of the core [m].
        radius: rounding radius [m]; 0 for solids with flat faces.
        planes: (m, 4) outward normals and offsets of a solid without radius, else (0, 4).
        facets: its flat faces; for a cylinder, its two ends.
        kind: sphere, capsule, box, cylinder or mesh.
    """

    core: np.ndarray
    radius: float
    planes: np.ndarray
    facets: tuple[Facet, ...]
    kind: str

    @property
    def middle(self) -> np.ndarray:
        """(3,) mean of the core's corners [m]."""
        return self.core.mean(axis=0)

    def lowest(self, direction: np.ndarray) -> float:
        """Return the smallest coordinate along a direction (3,), scaled by its length [m]."""
        return float((self.core @ direction).min()) - self.radius * float(np.linalg.norm(direction))

    def outline(self, view: DrawingView, wider: float = 0.0) -> np.ndarray:
        """Return the solid's outline as a convex polygon (k, 2) [m].

        Args:
            view: the view.
            wider: distance by which the solid is inflated [m].
        """
        flat = view.flat(self.core)
        grown = self.radius + wider
        return hull(flat if grown == 0.0 else (flat[:, None] + grown * CIRCLE).reshape(-1, 2))

    def hides(self, points: np.ndarray, view: DrawingView) -> np.ndarray:
        """Return whether the solid hides points from the viewer; it also hides the points inside it.

        Args:
            points: (n, 3) points [m].
            view: the view.

        Returns:
            (n,) True for hidden points.
        """
        if len(self.planes):
            ahead, outside = self.planes[:, :3] @ view.axes[2], points @ self.planes[:, :3].T + self.planes[:, 3]
            distances = -outside / np.where(np.abs(ahead) < 1e-9, np.nan, ahead)
            enters = np.nanmax(np.where(ahead < -1e-9, distances, -np.inf), axis=1)
            leaves = np.nanmin(np.where(ahead > 1e-9, distances, np.inf), axis=1)
            beside = (outside[:, np.abs(ahead) < 1e-9] > 0).any(axis=1)
            return (np.maximum(enters, 1e-6) < leaves) & ~beside
        ends, flat = view.flat(self.core), view.flat(points)
        along = ends[-1] - ends[0]
        share = np.clip((flat - ends[0]) @ along / max(float(along @ along), 1e-12), 0.0, 1.0)
        off = np.linalg.norm(flat - ends[0] - share[:, None] * along, axis=1)
        depths = view.depth(self.core)
        surface = depths[0] + share * (depths[-1] - depths[0]) + np.sqrt(np.maximum(self.radius**2 - off**2, 0.0))
        return (off < self.radius) & (view.depth(points) < surface)


def solid_of(shape: Shape, pose: Pose) -> ConvexSolid:
    """Return a shape of the planner as a solid in the world.

    Args:
        shape: the shape.
        pose: its pose in the world.
    """
    turn, at = pose.rotation, pose.position
    if isinstance(shape, Sphere):
        return ConvexSolid(at[None], shape.radius, np.zeros((0, 4)), (), "sphere")
    if isinstance(shape, Capsule):
        half = 0.5 * shape.length * turn[:, 2]
        return ball_along(at - half, at + half, shape.radius)
    if isinstance(shape, Cylinder):
        angle = 2.0 * np.pi * np.arange(RIM) / RIM
        ring = shape.radius * np.column_stack([np.cos(angle), np.sin(angle), np.zeros(RIM)])
        half = 0.5 * shape.length * turn[:, 2]
        rims = [ring @ turn.T + at + offset for offset in (-half, half)]
        ends = (Facet(rims[0], -turn[:, 2]), Facet(rims[1], turn[:, 2]))
        return ConvexSolid(np.vstack(rims), 0.0, _planes(np.vstack(rims)), ends, "cylinder")
    points = corner_points(shape) @ turn.T + at
    kind = "box" if isinstance(shape, Box) else "mesh"
    assert isinstance(shape, Box | Mesh)
    return ConvexSolid(points, 0.0, _planes(points), _facets(points), kind)


def ball_along(a: np.ndarray, b: np.ndarray, radius: float) -> ConvexSolid:
    """Return a capsule as a solid.

    Args:
        a: (3,) one end of its core [m].
        b: (3,) other end of its core [m].
        radius: its radius [m].
    """
    return ConvexSolid(np.stack([a, b]), radius, np.zeros((0, 4)), (), "capsule")


def hull(points: np.ndarray) -> np.ndarray:
    """Return the convex hull (k, 2) of points (n, 2), counterclockwise; all points if the hull has no area."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return points[ConvexHull(points).vertices]
    except QhullError:
        return points


def union(outlines: Sequence[np.ndarray]) -> list[np.ndarray]:
    """Return the borders (k, 2) of the union of counterclockwise convex polygons (n, 2) [m]."""
    from contourpy import contour_generator

    low, high = (f([f(outline, axis=0) for outline in outlines], axis=0) for f in (np.min, np.max))
    cell = float((high - low).max()) / CELLS
    x, y = (np.arange(low[k] - 3 * cell, high[k] + 3 * cell, cell) for k in (0, 1))
    outside = np.full((len(y), len(x)), 10.0)
    for outline in outlines:
        sides = np.roll(outline, -1, axis=0) - outline
        sides = sides[np.linalg.norm(sides, axis=1) > 1e-12]
        starts = outline[np.linalg.norm(np.roll(outline, -1, axis=0) - outline, axis=1) > 1e-12]
        normals = np.stack([sides[:, 1], -sides[:, 0]], axis=1) / np.linalg.norm(sides, axis=1)[:, None]
        (i, k), (j, m) = (
            (np.searchsorted(v, [a.min() - 3 * cell, a.max() + 3 * cell]))
            for v, a in ((x, outline[:, 0]), (y, outline[:, 1]))
        )
        part = np.full((m - j, k - i), -np.inf)
        for normal, start in zip(normals, starts, strict=True):
            np.maximum(part, (y[j:m, None] - start[1]) * normal[1] + (x[None, i:k] - start[0]) * normal[0], out=part)
        np.minimum(outside[j:m, i:k], part, out=outside[j:m, i:k])
    return [np.array(line) for line in contour_generator(x, y, outside).lines(0.0)]


def hidden_by(solids: Sequence[ConvexSolid], points: np.ndarray, view: DrawingView) -> np.ndarray:
    """Return which points any solid hides from the viewer.

    Args:
        solids: the solids.
        points: (n, 3) points [m].
        view: the view.

    Returns:
        (n,) True for hidden points.
    """
    out = np.zeros(len(points), dtype=bool)
    for solid in solids:
        out |= solid.hides(points, view)
    return out


def back_to_front(solids: Sequence[ConvexSolid], view: DrawingView) -> list[int]:
    """Return a painting order of solids.

    Args:
        solids: the solids.
        view: the view.

    Returns:
        Indices of the solids, from back to front.
    """
    count = len(solids)
    behind = np.zeros((count, count), dtype=bool)  # [i, j]: i must be painted before j
    for i in range(count):
        for j in range(i):
            side = _in_front(solids[i], solids[j], view)
            behind[j, i], behind[i, j] = side > 0, side < 0
    depths = [float(view.depth(solid.middle)) for solid in solids]
    left, order = set(range(count)), []
    while left:
        free = [i for i in left if not any(behind[j, i] for j in left)] or list(left)
        order.append(min(free, key=lambda i: (depths[i], i)))
        left.remove(order[-1])
    return order


def best_view(
    shown: np.ndarray, aside: np.ndarray, solids: Sequence[ConvexSolid], ghosts: Sequence[ConvexSolid]
) -> DrawingView:
    """Return the direction with the best view of a path: unobstructed, and apart from another path.

    Args:
        shown: (n, 3) the path of interest [m].
        aside: (m, 3) the path it departs from [m].
        solids: solids that may hide it.
        ghosts: solids, like the arm, that may hide the path and the centers of the other solids.
    """
    things = np.vstack([shown, *[solid.middle[None] for solid in solids]])
    best, most = DrawingView(-60.0, 25.0), -math.inf
    for elevation in ELEVATIONS:
        for azimuth in AZIMUTHS:
            view = DrawingView(float(azimuth), float(elevation))
            a, b = view.flat(shown), view.flat(aside)
            apart = np.linalg.norm(a[:, None] - b[None], axis=2).min(axis=1).mean()
            spread = np.ptp(a, axis=0).max()
            hidden = np.mean([solid.hides(shown, view) for solid in solids], axis=1).sum() if solids else 0.0
            veiled = np.mean([solid.hides(things, view) for solid in ghosts]) if ghosts else 0.0
            value = 2.5 * apart + 0.35 * spread - 0.22 * hidden - 2.0 * veiled - 0.0004 * abs(elevation - 26)
            if value > most:
                best, most = view, value
    return best


def _in_front(a: ConvexSolid, b: ConvexSolid, view: DrawingView) -> int:
    """Return 1 if a is in front of b, -1 if it is behind, 0 if the order is irrelevant."""
    towards = view.axes[2]
    for first, second, sign in ((b, a, 1), (a, b, -1)):
        for *normal, offset in first.planes:
            ahead = float(np.array(normal) @ towards)
            if abs(ahead) > 1e-6 and second.lowest(np.array(normal)) + offset > -1e-6:
                return sign if ahead > 0 else -sign
    if len(a.planes) and len(b.planes):
        return 0
    gap = float(view.depth(a.middle) - view.depth(b.middle))
    return 1 if gap > 0 else -1


def _planes(points: np.ndarray) -> np.ndarray:
    from scipy.spatial import ConvexHull

    rounded = np.round(ConvexHull(points).equations, 9)
    return np.unique(rounded, axis=0)


def _facets(points: np.ndarray) -> tuple[Facet, ...]:
    """Return the faces of a convex hull, with coplanar triangles joined."""
    from scipy.spatial import ConvexHull

    equations = ConvexHull(points).equations
    facets, seen = [], []
    for plane in equations:
        if any(np.abs(plane - other).max() < 1e-6 for other in seen):
            continue
        seen.append(plane)
        corners = points[np.abs(points @ plane[:3] + plane[3]) < 1e-7]
        u = corners[1] - corners[0]
        u = u / np.linalg.norm(u)
        flat = (corners - corners.mean(axis=0)) @ np.stack([u, np.cross(plane[:3], u)]).T
        facets.append(Facet(corners[np.argsort(np.arctan2(flat[:, 1], flat[:, 0]))], plane[:3]))
    return tuple(facets)
