"""Compiled tangent planes: their axes, and the displacements of children in them."""

from __future__ import annotations

import math

from ..geometry import screw
from ..jit import inlined, kernel

SIDES = 8
"""Number of regular children of a node: at the corners of a square and the middles of its sides."""
COSINES = tuple(math.cos(0.25 * math.pi * k) for k in range(SIDES))
"""Cosines of the regular children's directions in the plane."""


@kernel
def random_number(state):
    """Return a number in [0, 1) and advance the state (1,); equal on every machine (Park and Miller 1988)."""
    number = (16807 * int(state[0])) % 2147483647
    state[0] = number
    return number / 2147483647.0


@inlined
def _unit(v):
    length = math.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    if length < 1e-12:
        return (0.0, 0.0, 0.0)
    scale = 1.0 / length
    return (scale * v[0], scale * v[1], scale * v[2])


@inlined
def plane_basis(normal, towards, world_basis):
    """Return directions u and v of a plane, right-handed and orthonormal with the normal.

    Args:
        normal: (3,) unit normal.
        towards: (3,) direction to the pose of the path to reach: v is its part in the plane, so that the basis rotates
            with the problem.
        world_basis: 1: v from the world axis that is least along the normal instead. (The paper always takes the
            x axis, which fails if the normal is that axis.)
    """
    along = normal[0] * towards[0] + normal[1] * towards[1] + normal[2] * towards[2]
    v = (towards[0] - along * normal[0], towards[1] - along * normal[1], towards[2] - along * normal[2])
    if world_basis == 1.0 or v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < 1e-12:
        x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
        axis = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
        v = screw.cross(axis, normal)
    v = _unit(v)
    # nearly head-on the projection loses digits: project again
    along = normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2]
    v = _unit((v[0] - along * normal[0], v[1] - along * normal[1], v[2] - along * normal[2]))
    return screw.cross(v, normal), v


@inlined
def child_direction(k, normal, u, v, square, away, state):
    """Return the displacement of a child in units of the step.

    The regular children come first, then random children in the plane, with a random part along the normal.

    Args:
        k: number of the child.
        normal: (3,) unit normal of the plane.
        u: (3,) unit direction in the plane.
        v: (3,) unit direction in the plane.
        square: 1: children at the corners and the middles of the sides of a square, else on a circle.
        away: largest part of a random child's displacement along the normal.
        state: (1,) of the random numbers.
    """
    if k < SIDES:
        # the paper's children: corners of a square, and the middles of its sides at 1 / sqrt(2) of the distance
        size = math.sqrt(0.5) if square == 1.0 and k % 2 == 1 else 1.0
        a, b, c = size * COSINES[k], size * COSINES[(k + 6) % SIDES], 0.0
    else:
        a, b = 2.0 * random_number(state) - 1.0, 2.0 * random_number(state) - 1.0
        c = away * random_number(state)
    return (
        a * v[0] + b * u[0] + c * normal[0], a * v[1] + b * u[1] + c * normal[1], a * v[2] + b * u[2] + c * normal[2],
    )  # fmt: skip
