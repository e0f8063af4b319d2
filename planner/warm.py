"""What following among obstacles runs, run once before anybody waits for it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .arm import Arm
from .body import Body
from .pose import Pose, PosePath
from .reactive import ReactivePlanner
from .scene_work import SceneWork
from .shapes import Obstacle, Sphere


def warm_up(arm: Arm, body: Body) -> None:
    """Compile, or load from the cache, what following among obstacles may need, so that no tick has to wait for it."""
    q = 0.5 * (np.maximum(arm.lower, -1.0) + np.minimum(arm.upper, 1.0))
    path = PosePath(arm.fk(q).dq[None])
    things = (Obstacle(Sphere(0.01), Pose.from_position_quaternion([0.0, 0.0, 50.0]), np.array([0.0, 0.0, 1e-3])),)
    planner = ReactivePlanner(arm, body)
    for seen in (things, (replace(things[0], velocity=np.zeros(3)),)):
        planner.see(seen)
        planner.go(path)
        planner.step(q)
        planner.see(tuple(obstacle.at(0.02) for obstacle in seen))
        planner.step(q)
    # what names what is in the way
    scene = SceneWork.of(arm, body, things, planner.settings.plan)
    scene.tightest(q)
    scene.tightest_of_tool(path[0])
