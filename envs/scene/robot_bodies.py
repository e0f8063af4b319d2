"""Capsules that contain a robot's arms: fitted once (`fitted_bodies`), precomputed and shipped as a table."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from ...planner import Body, body_from_mujoco
from ...planner.errors import UnknownName
from ...planner.robot.body import BODY, Hull
from .robots import ROBOTS, WITH_PANDA_GRIPPER, Robot
from .scene import compiled_scene

TABLE = Path(__file__).parents[1] / "assets" / "bodies.json"
DIGITS = 5
"""Number of decimals of the shipped lengths [m]; radii are rounded up."""
WITH_HULLS = ("UR5e", "XArm7", "Jaco")
"""Robots whose capsules alone would refuse postures that they work in: their bodies have hulls."""


def fitted_bodies(robot: Robot) -> tuple[Body, ...]:
    """Fit the bodies of all arms of a robot to its collision geometry; takes some seconds per arm.

    A trunk shared by two arms is excluded: it is one of the scene's fixtures.
    """
    sides = tuple(robot.ready)
    scene = compiled_scene(robot, arms=sides)
    exact = robot.name in WITH_HULLS
    bodies = [body_from_mujoco(scene.model, index.arm, index.arm.joint_names, exact=exact) for index in scene.arms]
    return tuple(_rounded(body if len(sides) == 1 else body.moving()) for body in bodies)


@cache
def robot_body(robot: Robot, index: int = 0) -> Body:
    """Return the capsules of a robot's arm at the table, including its hand and the full range of the fingers.

    Args:
        robot: one of `ROBOTS`.
        index: index of the arm.

    Raises:
        UnknownName: no body is shipped for this robot.
    """
    table, name = json.loads(TABLE.read_text(encoding="utf-8")), _name(robot)
    if name not in table:
        raise UnknownName("robot with a body", name, table)
    entry = table[name][index]
    hulls = [Hull(np.array(hull["corners"]), hull["rounding"]) for hull in entry.get("hulls", ())]
    pairs = entry.get("pairs")
    return Body(
        np.array(entry["rows"]),
        tuple(entry["names"]),
        hulls=tuple(None if k < 0 else hulls[k] for k in entry.get("hull_of", ())),
        pairs=None if pairs is None else tuple((i, j) for i, j in pairs),
        margins={(i, j): margin for i, j, margin in entry.get("margins", ())},
    )


def table_text(robots: tuple[str, ...]) -> str:
    """Fit all bodies anew; return the text of the shipped table, written by `make bodies`.

    It has the given robots, and those of them that hold a Panda's gripper on request once more with it.
    """
    every = [ROBOTS[robot] for robot in robots] + [WITH_PANDA_GRIPPER[robot] for robot in WITH_PANDA_GRIPPER]
    table = {_name(robot): [_entry(body) for body in fitted_bodies(robot)] for robot in every}
    return json.dumps(table, indent=1) + "\n"


def _name(robot: Robot) -> str:
    """Return the name of a robot in the table."""
    other = ROBOTS.get(robot.name, robot).gripper != robot.gripper
    return f"{robot.name} {robot.gripper}" if other else robot.name


def _entry(body: Body) -> dict[str, Any]:
    entry: dict[str, Any] = {"names": list(body.names), "rows": body.rows.tolist()}
    if body.hulls:
        kept = list({id(hull): hull for hull in body.hulls if hull is not None}.values())
        place = {id(hull): k for k, hull in enumerate(kept)}
        entry["hulls"] = [{"corners": hull.corners.tolist(), "rounding": hull.rounding} for hull in kept]
        entry["hull_of"] = [-1 if hull is None else place[id(hull)] for hull in body.hulls]
    if body.pairs is not None:
        entry["pairs"] = [list(pair) for pair in body.pairs]
    if body.margins:
        entry["margins"] = [[i, j, margin] for (i, j), margin in body.margins.items()]
    return entry


def _rounded(body: Body) -> Body:
    rows = np.round(body.rows, DIGITS)
    # rounding may move the ends by half a unit per axis, so the radius grows by two
    rows[:, BODY.radius] = np.ceil(body.rows[:, BODY.radius] * 10**DIGITS + 2.0) / 10**DIGITS
    # corners move like the ends, so their rounding grows by as much
    rounded = {id(hull): _rounded_hull(hull) for hull in body.hulls if hull is not None}
    hulls = tuple(None if hull is None else rounded[id(hull)] for hull in body.hulls)
    margins = {pair: float(np.floor(margin * 10**DIGITS) / 10**DIGITS) for pair, margin in body.margins.items()}
    return Body(rows, body.names, hulls=hulls, pairs=body.pairs, margins=margins)


def _rounded_hull(hull: Hull) -> Hull:
    return Hull(np.round(hull.corners, DIGITS), float(np.ceil(hull.rounding * 10**DIGITS + 1.0) / 10**DIGITS))
