"""Random problems of a robot: start and goal clear of itself and of up to three obstacles."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ...planner import Box, Capsule, Cylinder, Obstacle, PlanSettings, Pose, Shape, Sphere
from ...planner.errors import PlanFailed
from ...planner.planning.planning_scene import PlanningScene, SceneTemplate
from ..robot.load_robot import LoadedRobot
from ..robot.robot_summary import postures_of, reach_of

MOST = 3
"""Largest number of obstacles."""
SIZES = (0.06, 0.25)
"""Smallest and largest extent of an obstacle, as a share of the robot's reach."""
TRIES = 20_000
"""Random draws for one posture or obstacle until there is none."""


class RandomProblem(NamedTuple):
    """A motion to plan.

    Attributes:
        start: (dof,) joints [rad or m].
        goal: (dof,) joints at which the tool is at the goal [rad or m]; planned is for its pose.
        obstacles: in the world.
    """

    start: np.ndarray
    goal: np.ndarray
    obstacles: tuple[Obstacle, ...]


def random_problems(robot: LoadedRobot, rng: np.random.Generator, count: int, *, among: bool) -> list[RandomProblem]:
    """Draw problems: uniform postures that the planner does not refuse, and obstacles that leave both of them clear.

    Args:
        robot: the robot.
        rng: of all draws.
        count: number of problems.
        among: draw one to three obstacles each; else none.

    Raises:
        PlanFailed: "no_posture", no random posture is clear.
    """
    settings, reach = PlanSettings(), reach_of(robot.arm)
    template = SceneTemplate(robot.arm, robot.body, settings.safety, settings.motion.dt)
    alone = PlanningScene(template, (), settings.repet.distance)
    found = []
    for _ in range(count):
        start, goal = (clear_posture(robot, alone, rng) for _ in range(2))
        obstacles: list[Obstacle] = []
        wanted = int(rng.integers(1, MOST + 1)) if among else 0
        for _ in range(TRIES):
            if len(obstacles) == wanted:
                break
            new = _obstacle(robot, rng, reach, f"obstacle {len(obstacles) + 1}")
            scene = PlanningScene(template, (new,), settings.repet.distance)
            if min(scene.slack(start), scene.slack(goal), scene.tool_slack(robot.arm.fk(goal))) >= 0.0:
                obstacles.append(new)
        found.append(RandomProblem(start, goal, tuple(obstacles)))
    return found


def clear_posture(robot: LoadedRobot, scene: PlanningScene, rng: np.random.Generator) -> np.ndarray:
    """Return a random posture (dof,) that is clear in a scene.

    Args:
        robot: the robot.
        scene: it, and what is around it.
        rng: of the draws.

    Raises:
        PlanFailed: "no_posture", none is clear.
    """
    low, high = postures_of(robot.arm)
    for _ in range(TRIES):
        q = rng.uniform(low, high)
        if scene.slack(q) >= 0.0:
            return q
    raise PlanFailed("no_posture", f"none of {TRIES} random postures is clear: {scene.tightest(q)}")


def _obstacle(robot: LoadedRobot, rng: np.random.Generator, reach: float, name: str) -> Obstacle:
    """A random obstacle about a place that the tool reaches."""
    place = robot.arm.fk(rng.uniform(*postures_of(robot.arm))).position
    x, y, z = (float(extent) for extent in reach * rng.uniform(*SIZES, 3))
    shapes: list[Shape] = [Box((x, y, z)), Sphere(0.5 * x), Cylinder(0.5 * x, y), Capsule(0.5 * x, y)]
    turn = rng.normal(size=4)
    pose = Pose.from_position_quaternion(place, turn / np.linalg.norm(turn))
    return Obstacle(shapes[int(rng.integers(len(shapes)))], pose, name=name)
