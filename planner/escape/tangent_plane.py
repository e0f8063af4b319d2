"""Compiled tangent planes: their axes, and the ways that children go in them."""

from __future__ import annotations

import math

from ..geometry import screw
from ..jit import inlined, kernel

SIDES = 8
COSINES = tuple(math.cos(0.25 * math.pi * k) for k in range(SIDES))
"""Ways that every node looks at: the corners and the middles of the sides."""


@kernel
def random_number(state):
    """A number in [0, 1) from a state (1,) that it moves on; the same on every machine (Park and Miller 1988)."""
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
    """Directions u and v of a plane: right-handed and orthonormal with the normal.

    Args:
        normal: (3,) unit.
        towards: (3,) where the path goes on: v is its part in the plane, so that the basis turns with the problem.
        world_basis: 1: v from the world axis that is least along the normal instead. (The paper always takes the
            x axis, which fails where the normal is that axis.)
    """
    along = normal[0] * towards[0] + normal[1] * towards[1] + normal[2] * towards[2]
    v = (towards[0] - along * normal[0], towards[1] - along * normal[1], towards[2] - along * normal[2])
    if world_basis == 1.0 or v[0] * v[0] + v[1] * v[1] + v[2] * v[2] < 1e-12:
        x, y, z = abs(normal[0]), abs(normal[1]), abs(normal[2])
        axis = (1.0, 0.0, 0.0) if x <= y and x <= z else ((0.0, 1.0, 0.0) if y <= z else (0.0, 0.0, 1.0))
        v = screw.cross(axis, normal)
    v = _unit(v)
    # nearly head-on the projection has lost digits: once more
    along = normal[0] * v[0] + normal[1] * v[1] + normal[2] * v[2]
    v = _unit((v[0] - along * normal[0], v[1] - along * normal[1], v[2] - along * normal[2]))
    return screw.cross(v, normal), v


@inlined
def child_direction(k, normal, u, v, square, away, state):
    """Way of child k in units of the step: eight sides, then random ones in the plane, some with a part outwards."""
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
