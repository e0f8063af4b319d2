"""Bodies with something in the hand, and of a robot that stands elsewhere."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.arms import table_panda

from onedemo.planner.errors import BadShape, WrongType
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.robot.body import BODY

IN_HAND = Pose.from_position_quaternion([0.0, 0.01, 0.03])
BAR = Obstacle(Box((0.02, 0.1, 0.02)), Pose.from_position_quaternion([0.04, 0.0, 0.0]))
BALL = Obstacle(Sphere(0.02), Pose.from_position_quaternion([-0.05, 0.0, 0.0]))


def test_an_object_of_several_solids_is_covered_solid_by_solid():
    arm, body, _ = table_panda()
    held = body.holding("held", (BAR, BALL), IN_HAND, arm)
    apart = [body.holding("held", each.shape, IN_HAND @ each.pose, arm) for each in (BAR, BALL)]
    mine = held.rows[len(body) :]
    np.testing.assert_allclose(mine, np.vstack([each.rows[len(body) :] for each in apart]), atol=1e-12)
    assert held.held == ("held",) and set(held.names[len(body) :]) == {"held"}
    assert (held.pairs is None) == (body.pairs is None)
    if held.pairs is not None:
        assert {j for _, j in held.pairs if j >= len(body)} == set(range(len(body), len(held)))
    np.testing.assert_array_equal(held.released().rows, body.rows)


def test_one_shape_is_held_as_before():
    arm, body, _ = table_panda()
    one = body.holding("held", BALL.shape, IN_HAND, arm)
    np.testing.assert_array_equal(one.rows, body.holding("held", [Obstacle(BALL.shape)], IN_HAND, arm).rows)


@pytest.mark.parametrize("shape", [(), [Sphere(0.02)], "ball", None, [BALL, 3]])
def test_what_is_neither_a_shape_nor_solids_cannot_be_held(shape):
    arm, body, _ = table_panda()
    with pytest.raises(WrongType, match=r"shape is .*expected a Sphere, Capsule, Box, Cylinder or Mesh, or a sequence"):
        body.holding("held", shape, IN_HAND, arm)


def test_a_robot_that_stands_elsewhere_has_its_base_there():
    _, body, _ = table_panda()
    by = np.array([0.1, -0.2, 0.05])
    other, base = body.with_base_moved(by), body.rows[:, BODY.frame] < 0
    assert base.any()
    for column in (BODY.a, BODY.b):
        shift = other.rows[:, column : column + 3] - body.rows[:, column : column + 3]
        np.testing.assert_allclose(shift, np.where(base[:, None], by, 0.0), atol=1e-15)
    assert other.names == body.names and other.pairs == body.pairs
    with pytest.raises(BadShape, match="by has shape"):
        body.with_base_moved([0.1, 0.2])
