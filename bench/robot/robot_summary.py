"""Numbers that sum up a robot: its reach, and how tightly capsules enclose its geometry."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...planner import Arm
from ...planner.fitting.robot_model import Geometry, places_of
from ...planner.geometry.hulls import Cover, capsule_volume, union_volume
from ...planner.robot.body import BODY
from .load_robot import LoadedRobot

SAMPLES = 2000
"""Number of random postures that the search for the reach begins with."""
BEST, ROUNDS, VALUES = 5, 3, 25
"""Number of postures that are improved, rounds over all joints, and positions tried per joint."""
CLOSED = 1e-6
"""Largest sum of the area vectors of a closed surface, as a fraction of its area: rounding."""
ENDLESS = np.pi
"""Limit [rad] of joints without one, in a search over postures."""


class PieceVolume(NamedTuple):
    """A part of the body.

    Attributes:
        name: of its capsules.
        capsules: number of them.
        volume: of their union [m^3].
        geometry: sum of the volumes of its elements [m^3]; NaN for what is swept.
    """

    name: str
    capsules: int
    volume: float
    geometry: float


def postures_of(arm: Arm) -> tuple[np.ndarray, np.ndarray]:
    """Return lower and upper limits (dof,) with finite ones in place of infinite ones."""
    return np.where(np.isfinite(arm.lower), arm.lower, -ENDLESS), np.where(np.isfinite(arm.upper), arm.upper, ENDLESS)


def reach_of(arm: Arm) -> float:
    """Return about the largest distance [m] of the tool from the first joint's origin, by a search over postures."""
    low, high = postures_of(arm)
    origin = arm.chain[0, 4:7]

    def distance(q: np.ndarray) -> float:
        return float(np.linalg.norm(arm.fk(q).position - origin))

    rng = np.random.default_rng(0)
    samples = rng.uniform(low, high, (SAMPLES, arm.dof))
    order = np.argsort([-distance(q) for q in samples])[:BEST]
    best = 0.0
    for q in samples[order]:
        for joint in [*range(arm.dof)] * ROUNDS:
            tried = np.repeat(q[None], VALUES, axis=0)
            tried[:, joint] = np.linspace(low[joint], high[joint], VALUES)
            q = max([q, *tried], key=distance)
        best = max(best, distance(q))
    return best


def volumes_of(robot: LoadedRobot) -> list[PieceVolume]:
    """Return the volumes of every part of a body, base first."""
    body, read = robot.body, robot.parts.robot
    places, swept = places_of(read.parts, robot.arm.dof), swept_parts(robot)
    out = []
    for name in dict.fromkeys(body.names):
        rows = body.rows[np.array(body.names) == name]
        cover: Cover = [(row[BODY.a : BODY.b], row[BODY.b : BODY.radius], float(row[BODY.radius])) for row in rows]
        parts = [part for part, place in zip(read.parts, places, strict=True) if place.piece == name]
        solid = np.nan if name in swept else sum(volume_of(geometry) for part in parts for geometry in part.geometry)
        out.append(PieceVolume(name, len(rows), union_volume(cover), float(solid)))
    return out


def swept_parts(robot: LoadedRobot) -> set[str]:
    """Return the names of the parts of a body that are covered in every position of joints that are not the arm's."""
    read = robot.parts.robot
    names = [place.piece for place in places_of(read.parts, robot.arm.dof)]
    return {name for part, name in zip(read.parts, names, strict=True) if name == "fingers" or (name and part.joints)}


def volume_of(geometry: Geometry) -> float:
    """Return the volume [m^3] of an element: that of its mesh if it is closed, else of its hull; or of capsules."""
    from scipy.spatial import ConvexHull, QhullError

    exact = sum(capsule_volume(capsule) for capsule in geometry.exact)
    try:
        hull = float(ConvexHull(geometry.points).volume) if len(geometry.points) > 3 else 0.0
    except QhullError:
        hull = 0.0
    a, b, c = (geometry.triangles[:, k] for k in range(3))
    areas = np.cross(b - a, c - a)
    inside = abs(float(np.einsum("ij,ij->i", a, np.cross(b, c)).sum())) / 6.0
    closed = len(areas) > 0 and np.linalg.norm(areas.sum(axis=0)) < CLOSED * np.linalg.norm(areas, axis=1).sum()
    return exact + (inside if closed and 0.0 < inside < hull else hull)
