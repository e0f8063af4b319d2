"""The judge's own solids of URDF files: each kind of element encloses what the file says."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest
from helpers.models.urdf_text import joint, written
from scipy.spatial import ConvexHull

from onedemo.bench.robot.urdf_solids import UrdfSolids


def block(path) -> None:
    """Write an OBJ file of a block of 0.2 x 0.3 x 0.4 m about the origin."""
    corners = np.array(list(product((-0.1, 0.1), (-0.15, 0.15), (-0.2, 0.2))))
    hull = ConvexHull(corners)
    lines = [f"v {x} {y} {z}" for x, y, z in corners]
    for (i, j, k), plane in zip(hull.simplices, hull.equations, strict=True):
        outward = np.cross(corners[j] - corners[i], corners[k] - corners[i]) @ plane[:3] > 0.0
        lines.append(f"f {i + 1} {(j if outward else k) + 1} {(k if outward else j) + 1}")
    path.write_text("\n".join(lines) + "\n")


BLOCK = '<geometry><mesh filename="block.obj"/></geometry>'


@pytest.mark.parametrize(
    "element, checking",
    [
        ('<geometry><box size="0.2 0.3 0.4"/></geometry>', ""),
        (BLOCK, ""),
        # what says that its meshes are convex becomes a solid of another class
        (BLOCK, '<collision_checking><convex name="it"/></collision_checking>'),
    ],
    ids=["box", "mesh", "convex mesh"],
)
def test_a_block_is_a_block_however_it_is_written(element, checking, tmp_path):
    """Balls of the base lie half a meter along each axis; the ball about the block has half its diagonal."""
    block(tmp_path / "block.obj")
    ball = '<collision><origin xyz="{}"/><geometry><sphere radius="0.05"/></geometry></collision>'
    base = "".join(ball.format(place) for place in ("0.5 0 0", "0 0.5 0", "0 0 0.5", "0 0 0.1"))
    file = written(
        tmp_path,
        f'<link name="base">{base}</link>',
        f'<link name="arm"><collision name="it">{element}</collision>{checking}</link>',
        joint("turn", "base", "arm", axis="1 0 0"),
    )
    solids = UrdfSolids(file, ["turn"], {})
    arm, balls = solids.links.index("arm"), [k for k, name in enumerate(solids.links) if name == "base"]
    assert solids.balls[arm] == pytest.approx(0.5 * np.linalg.norm([0.2, 0.3, 0.4]))
    for turned, gaps in ((0.0, (0.35, 0.3, 0.25)), (0.5 * np.pi, (0.35, 0.25, 0.3))):
        solids.move(np.array([turned]))
        assert [solids.distance(arm, k) for k in balls[:3]] == pytest.approx(gaps, abs=5e-4)
        assert [solids.touch(arm, k) for k in balls] == [False, False, False, True]
