"""Baxter's trunk cut into slices.

MuJoCo collides with a mesh's convex hull. The hull of the whole trunk fills the hollow in front of the shoulders, where
the upper arms move: half of the shoulder's range would be a collision although the real surface is 5 cm away.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement

import numpy as np

from ...planner.geometry.shapes import hull_corners

TRUNK = "_base_link_col"
"""Suffix of the name of the trunk's collision geom."""
SLICES = 6
STL_HEADER = 84
"""Number of bytes before the triangles of a binary STL file."""
TRIANGLE = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])


def slice_trunk(root: Element) -> None:
    """Replace the trunk's collision geom, if there is one, by the convex hulls of its slices."""
    assets = root.find("asset")
    for body in root.iter("body"):
        for geom in body.findall("geom"):
            name = geom.get("name") or ""
            if name.endswith(TRUNK) and assets is not None:
                mesh = next(each for each in assets.iter("mesh") if each.get("name") == geom.get("mesh"))
                for k, corners in enumerate(slices(triangles(Path(mesh.get("file") or "")), SLICES)):
                    text = " ".join(f"{value:.6g}" for value in corners.ravel())
                    SubElement(assets, "mesh", {"name": f"{name}{k}", "vertex": text})
                    if k:
                        SubElement(body, "geom", {**geom.attrib, "name": f"{name}{k}", "mesh": f"{name}{k}"})
                # robosuite looks the geom up by name
                geom.set("mesh", f"{name}0")
                assets.remove(mesh)


def triangles(file: Path) -> np.ndarray:
    """Return the corners (n, 3, 3) [m] of the triangles in a binary STL file."""
    return np.frombuffer(file.read_bytes()[STL_HEADER:], dtype=TRIANGLE)["corners"].astype(np.float64)


def slices(faces: np.ndarray, count: int) -> list[np.ndarray]:
    """Return the hull corners (m, 3) of each horizontal slice of a surface, from the lowest slice up.

    Args:
        faces: (n, 3, 3) triangles of a closed surface [m].
        count: number of slices of equal height.
    """
    points = faces.reshape(-1, 3)
    edges = np.concatenate([faces[:, [0, 1]], faces[:, [1, 2]], faces[:, [2, 0]]])
    heights = np.linspace(points[:, 2].min(), points[:, 2].max(), count + 1)
    found = []
    for low, high in pairwise(heights):
        inside = points[(points[:, 2] >= low) & (points[:, 2] <= high)]
        cloud = np.vstack([inside, *(_cut(edges, height) for height in (low, high))])
        found.append(cloud[hull_corners(cloud)])
    return found


def _cut(edges: np.ndarray, height: float) -> np.ndarray:
    """Return the points (m, 3) where edges (n, 2, 3) cross a height."""
    a, b = edges[:, 0], edges[:, 1]
    through = (a[:, 2] - height) * (b[:, 2] - height) < 0.0
    a, b = a[through], b[through]
    share = (height - a[:, 2]) / (b[:, 2] - a[:, 2])
    return a + share[:, None] * (b - a)
