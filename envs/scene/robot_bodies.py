"""Capsules that contain a robot's arms: fitted once (`fitted_bodies`), precomputed and shipped as a table."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from ...planner import Body, body_from_mujoco
from ...planner.errors import UnknownName
from ...planner.robot.body import BODY
from .robots import ROBOTS, Robot
from .scene import compiled_scene

TABLE = Path(__file__).parents[1] / "assets" / "bodies.json"
DIGITS = 5
"""Number of decimals of the shipped lengths [m]; radii are rounded up."""


def fitted_bodies(robot: Robot) -> tuple[Body, ...]:
    """Fit the bodies of all arms of a robot to its collision geometry; takes some seconds per arm.

    A trunk shared by two arms is excluded: it is one of the scene's fixtures.
    """
    sides = tuple(robot.ready)
    scene = compiled_scene(robot, arms=sides)
    bodies = [body_from_mujoco(scene.model, index.arm, index.arm.joint_names) for index in scene.arms]
    return tuple(_rounded(body if len(sides) == 1 else _moving(body)) for body in bodies)


@cache
def robot_body(robot: Robot, index: int = 0) -> Body:
    """Return the capsules of a robot's arm at the table, including its hand and the full range of the fingers.

    Args:
        robot: of `ROBOTS`.
        index: index of the arm.

    Raises:
        UnknownName: no body is shipped for this robot.
    """
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    if robot.name not in table:
        raise UnknownName("robot with a body", robot.name, table)
    entry = table[robot.name][index]
    return Body(np.array(entry["rows"]), tuple(entry["names"]))


def table_text(robots: tuple[str, ...]) -> str:
    """Fit all bodies anew; return the text of the shipped table, written by `make bodies`."""
    table = {
        robot: [{"names": list(body.names), "rows": body.rows.tolist()} for body in fitted_bodies(ROBOTS[robot])]
        for robot in robots
    }
    return json.dumps(table, indent=1) + "\n"


def _moving(body: Body) -> Body:
    """Return a body without its fixed capsules."""
    keep = np.flatnonzero(body.rows[:, BODY.frame] >= 0)
    return Body(body.rows[keep], tuple(body.names[k] for k in keep))


def _rounded(body: Body) -> Body:
    rows = np.round(body.rows, DIGITS)
    # rounding may move the ends by half a unit per axis, so the radius grows by two
    rows[:, BODY.radius] = np.ceil(body.rows[:, BODY.radius] * 10**DIGITS + 2.0) / 10**DIGITS
    return Body(rows, body.names)
