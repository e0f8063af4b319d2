"""Solids that are not convex: what is cut, what cannot be, and which parts count as resting on each other."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.models.urdf_text import joint, link, written
from scipy.spatial import ConvexHull

from onedemo.planner import Arm, Pose, body_from_urdf
from onedemo.planner.errors import UnfitShape
from onedemo.planner.fitting.link_pieces import Piece
from onedemo.planner.fitting.refined_pieces import _cut
from onedemo.planner.fitting.robot_parts import Geometry
from onedemo.planner.geometry.convex_pieces import WORTH, best_cut
from onedemo.planner.geometry.shapes import hull_corners


def box(low, high) -> np.ndarray:
    """Triangles (12, 3, 3) of a box between two corners."""
    corners = np.array([[x, y, z] for x in (low[0], high[0]) for y in (low[1], high[1]) for z in (low[2], high[2])])
    return corners[ConvexHull(corners).simplices]


def channel(hollow: float) -> np.ndarray:
    """Triangles of a block of 0.2 m with a channel along its top, this deep [m]."""
    floor = box((-0.1, -0.1, 0.0), (0.1, 0.1, 0.1))
    walls = [box((x, -0.1, 0.1), (x + 0.05, 0.1, 0.1 + hollow)) for x in (-0.1, 0.05)]
    return np.concatenate([floor, *walls])


def saved(path, triangles: np.ndarray) -> None:
    """Write an STL file of a surface."""
    facets = np.zeros(len(triangles), dtype=[("normal", "<3f4"), ("corners", "<(3,3)f4"), ("rest", "<u2")])
    facets["corners"] = triangles
    path.write_bytes(b"".ljust(80) + np.uint32(len(facets)).tobytes() + facets.tobytes())


def test_where_no_plane_frees_all_points_one_frees_the_worst():
    """Eleven points under the hull's top, at its edge, which no cut frees, and one in the middle of the channel."""
    triangles = channel(0.006)
    edge = [[-0.1, y, 0.106] for y in np.linspace(-0.09, 0.09, 11)]
    points = np.array([[0.0, 0.0, 0.1055], *edge])
    assert best_cut(triangles, points) == [] and 0.0055 / len(points) < WORTH
    piece = Piece("link1", 0, Pose.identity(), Geometry([], triangles.reshape(-1, 3), triangles))
    cut = _cut([piece], {id(piece): [(0.004, points[0]), *((0.003, point) for point in points[1:])]}, {}, 10)
    assert len(cut) == 2
    planes = [ConvexHull(part.geometry.points).equations for part in cut]
    assert all((p[:, :3] @ points[0] + p[:, 3]).max() > 0.001 for p in planes)


def test_a_cut_that_leaves_no_solid_is_refused():
    """A block with a long needle that ends in many tiny triangles: no plane beside the block leaves two solids."""
    rng = np.random.default_rng(0)
    tip = np.array([0.4, 0.05, 0.05]) + 3e-6 * rng.normal(size=(200, 3, 3))
    needle = np.array([[[0.1, 0.05, 0.05], [0.4, 0.05, 0.05], [0.4, 0.05 + 1e-6, 0.05]]])
    triangles = np.concatenate([box((0.0, 0.0, 0.0), (0.1, 0.1, 0.1)), tip, needle])
    between = np.array([[0.2, 0.03, 0.05], [0.15, 0.05, 0.02], [0.25, 0.06, 0.05]])
    assert best_cut(triangles, between) == []
    with pytest.raises(UnfitShape):
        hull_corners(np.concatenate([tip, needle]).reshape(-1, 3))


RING = np.concatenate(
    [
        box((-0.3, -0.3, 0.0), (-0.2, 0.3, 0.1)),
        box((0.2, -0.3, 0.0), (0.3, 0.3, 0.1)),
        box((-0.3, -0.3, 0.0), (0.3, -0.2, 0.1)),
        box((-0.3, 0.2, 0.0), (0.3, 0.3, 0.1)),
    ]
)
"""Surface of a square ring, 0.4 m wide inside."""


@pytest.mark.parametrize(
    "reach, meets",
    [
        (0.15, False),  # it never leaves the hollow
        (0.22, True),  # a ball on a turning bar: it meets the ring on its way round, not in the corners
    ],
)
def test_a_part_in_the_hollow_of_another_does_not_rest_on_it(reach, meets, tmp_path):
    """The hull of the ring contains it in every posture; the ring itself decides."""
    saved(tmp_path / "ring.stl", RING)
    file = written(
        tmp_path,
        link("base", '<mesh filename="ring.stl"/>'),
        link("column"),
        link("bar"),
        f'<link name="ball"><collision><origin xyz="{reach} 0 0"/><geometry><sphere radius="0.02"/></geometry>'
        "</collision></link>",
        joint("turn", "base", "column", "continuous", xyz="0 0 0.05"),
        joint("lift", "column", "bar", "prismatic", more='<limit lower="0" upper="0.02" effort="1" velocity="1"/>'),
        joint("roll", "bar", "ball", axis="1 0 0"),
    )
    body = body_from_urdf(file, Arm.from_urdf(file, tcp_frame="ball"))
    assert {(body.names[i], body.names[j]) for i, j in body.pairs} == ({("link0", "link3")} if meets else set())
