"""The capsules that contain a robot's arms: fitted once (`fitted_bodies`), shipped as a table, read in no time."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np

from ...planner.errors import UnknownName
from ...planner.robot.body import FRAME, Body
from ...planner.robot.body_readers import body_from_mujoco
from .robots import robot_named
from .scene import compiled_scene

TABLE = Path(__file__).parents[1] / "assets" / "bodies.json"
DIGITS = 5
"""Of the shipped numbers [m]; radii are rounded up."""


def fitted_bodies(robot: str) -> tuple[Body, ...]:
    """The bodies of all arms of a robot, fitted to its collision geometry; takes some seconds per arm.

    The trunk that two arms share is no part of them: it is among the scene's fixtures.
    """
    sides = tuple(robot_named(robot).ready)
    scene = compiled_scene(robot, arms=sides)
    bodies = [body_from_mujoco(scene.model, index.arm, index.arm.joint_names) for index in scene.arms]
    return tuple(_rounded(body if len(sides) == 1 else _moving(body)) for body in bodies)


@cache
def robot_body(robot: str, index: int = 0) -> Body:
    """The capsules of a robot's arm as it stands at the table, hand and fingers over their whole range included.

    Raises:
        UnknownName: no such robot is shipped.
    """
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    if robot not in table:
        raise UnknownName("robot with a body", robot, table)
    entry = table[robot][index]
    return Body(np.array(entry["rows"]), tuple(entry["names"]))


def table_text(robots: tuple[str, ...]) -> str:
    """The shipped table, fitted anew: what `make bodies` writes."""
    table = {
        robot: [{"names": list(body.names), "rows": body.rows.tolist()} for body in fitted_bodies(robot)]
        for robot in robots
    }
    return json.dumps(table, indent=1) + "\n"


def _moving(body: Body) -> Body:
    """A body without what does not move."""
    keep = np.flatnonzero(body.rows[:, FRAME] >= 0)
    return Body(body.rows[keep], tuple(body.names[k] for k in keep))


def _rounded(body: Body) -> Body:
    rows = np.round(body.rows, DIGITS)
    # the ends may move by half a unit each way, so the radius takes up two
    rows[:, 7] = np.ceil(body.rows[:, 7] * 10**DIGITS + 2.0) / 10**DIGITS
    return Body(rows, body.names)
