"""Surfaces given by triangles: distances of points, their nearest points, and what lies inside.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

import numpy as np

from ..jit import kernel

RAYS = np.array([[0.8147, 0.4321, 0.3891], [-0.3257, 0.7741, -0.5431], [0.2113, -0.6329, -0.7448]])
"""Directions along no axis."""


def to_triangles(points: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return the distances (n,) [m] of points from a surface.

    Args:
        points: (n, 3) [m].
        triangles: (m, 3, 3) of the surface [m].
    """
    edges = [_to_segments(points[:, None], triangles[:, k], triangles[:, (k + 1) % 3]) for k in range(3)]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    above = np.broadcast_to(lengths > 0.0, edges[0].shape).copy()
    for k in range(3):
        along = triangles[:, (k + 1) % 3] - triangles[:, k]
        above &= np.einsum("nmd,md->nm", points[:, None] - triangles[:, k], np.cross(normals, along)) >= 0.0
    height = np.abs(np.einsum("nmd,md->nm", points[:, None] - triangles[:, 0], normals)) / np.maximum(lengths, 1e-300)
    return np.where(above, height, np.minimum.reduce(edges)).min(axis=1)


def nearest_on_triangles(point: np.ndarray, triangles: np.ndarray) -> np.ndarray:
    """Return about the nearest point (3,) of a surface: a corner, or a point inside a triangle.

    Args:
        point: (3,) [m].
        triangles: (n, 3, 3) of the surface [m].
    """
    corners = triangles.reshape(-1, 3)
    best = corners[np.linalg.norm(corners - point, axis=1).argmin()]
    normals = np.cross(triangles[:, 1] - triangles[:, 0], triangles[:, 2] - triangles[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    flat = lengths > 0.0
    normals, inside = normals[flat] / lengths[flat, None], triangles[flat]
    heights = np.einsum("nd,nd->n", point - inside[:, 0], normals)
    feet, above = point - heights[:, None] * normals, np.ones(len(inside), dtype=bool)
    for k in range(3):
        along = inside[:, (k + 1) % 3] - inside[:, k]
        above &= np.einsum("nd,nd->n", feet - inside[:, k], np.cross(normals, along)) >= 0.0
    if above.any():
        k = int(np.where(above, np.abs(heights), np.inf).argmin())
        best = feet[k] if abs(heights[k]) < np.linalg.norm(best - point) else best
    return best


def cut_off(triangles: np.ndarray, normal: np.ndarray, height: float) -> np.ndarray:
    """Return the part of triangles that lies below a plane.

    Args:
        triangles: (n, 3, 3) [m].
        normal: (3,) unit normal of the plane.
        height: of the plane along the normal [m].

    Returns:
        Triangles (k, 3, 3) [m].
    """
    heights = triangles @ normal - height
    below = (heights <= 0.0).sum(axis=1)
    parts = [triangles[below == 3]]
    for count in (1, 2):
        some = below == count
        # the corner that is alone on its side comes first
        alone = (heights[some] <= 0.0).argmax(axis=1) if count == 1 else (heights[some] > 0.0).argmax(axis=1)
        order = (alone[:, None] + np.arange(3)) % 3
        corners = np.take_along_axis(triangles[some], order[:, :, None], axis=1)
        high = np.take_along_axis(heights[some], order, axis=1)
        share = high[:, :1] / (high[:, :1] - high[:, 1:])
        on_plane = corners[:, :1] + share[:, :, None] * (corners[:, 1:] - corners[:, :1])
        if count == 1:
            parts.append(np.concatenate([corners[:, :1], on_plane], axis=1))
        else:
            parts.append(np.stack([corners[:, 1], corners[:, 2], on_plane[:, 0]], axis=1))
            parts.append(np.stack([corners[:, 2], on_plane[:, 0], on_plane[:, 1]], axis=1))
    return np.concatenate(parts)


def shells_of(triangles: np.ndarray) -> list[np.ndarray]:
    """Return the parts (k, 3, 3) of a surface of triangles (n, 3, 3) that share no corner.

    Solids that overlap are such parts, and so are the outer and the inner side of a hollow one.
    """
    from scipy.sparse import csr_array
    from scipy.sparse.csgraph import connected_components

    corners = np.unique(triangles.reshape(-1, 3), axis=0, return_inverse=True)[1].reshape(-1, 3)
    # with indices of 64 bits an old SciPy leaves all labels 0, and says so on the console only
    count, ends = int(corners.max()) + 1, np.vstack([corners[:, :2], corners[:, 1:]]).astype(np.int32)
    graph = csr_array((np.ones(len(ends)), (ends[:, 0], ends[:, 1])), shape=(count, count))
    graph.indices, graph.indptr = graph.indices.astype(np.int32), graph.indptr.astype(np.int32)
    labels = connected_components(graph, directed=False)[1][corners[:, 0]]
    order = np.argsort(labels, kind="stable")
    return np.split(triangles[order], np.flatnonzero(np.diff(labels[order])) + 1)


def is_inside(point: np.ndarray, triangles: np.ndarray) -> bool:
    """Return whether a point (3,) lies inside a surface of triangles (n, 3, 3) [m], in any order of their corners.

    Most of three rays from the point must cross the surface an odd number of times: one may leave by a hole, or meet
    an edge. Where parts of the surface lie inside each other, or overlap, ask each by itself, see `shells_of`.

    Args:
        point: (3,) [m].
        triangles: (n, 3, 3) of the surface [m].
    """
    odd = 0
    for number, ray in enumerate(RAYS):
        if number == 2 and odd != 1:  # the two before agree
            break
        odd += _crossings(np.ascontiguousarray(triangles), point, ray) % 2
    return odd >= 2


@kernel
def _crossings(triangles, point, ray):
    """Return how often a ray from a point (3,) crosses triangles (n, 3, 3)."""
    px, py, pz = point[0], point[1], point[2]
    rx, ry, rz = ray[0], ray[1], ray[2]
    count = 0
    for k in range(len(triangles)):
        ax, ay, az = triangles[k, 0, 0], triangles[k, 0, 1], triangles[k, 0, 2]
        ex, ey, ez = triangles[k, 1, 0] - ax, triangles[k, 1, 1] - ay, triangles[k, 1, 2] - az
        ox, oy, oz = triangles[k, 2, 0] - ax, triangles[k, 2, 1] - ay, triangles[k, 2, 2] - az
        cx, cy, cz = ry * oz - rz * oy, rz * ox - rx * oz, rx * oy - ry * ox
        volume = ex * cx + ey * cy + ez * cz
        if volume == 0.0:
            continue
        fx, fy, fz = px - ax, py - ay, pz - az
        u = (fx * cx + fy * cy + fz * cz) / volume
        if u < 0.0 or u > 1.0:
            continue
        gx, gy, gz = fy * ez - fz * ey, fz * ex - fx * ez, fx * ey - fy * ex
        v = (gx * rx + gy * ry + gz * rz) / volume
        if v >= 0.0 and u + v <= 1.0 and (ox * gx + oy * gy + oz * gz) / volume > 0.0:
            count += 1
    return count


def _to_segments(points: np.ndarray, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """Distances (n, m) [m] of points (n, 1, 3) from segments (m, 3)."""
    along = b - a
    share = np.einsum("nmd,md->nm", points - a, along) / np.maximum((along * along).sum(axis=1), 1e-300)
    return np.linalg.norm(points - a - np.clip(share, 0.0, 1.0)[:, :, None] * along, axis=2)
