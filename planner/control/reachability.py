"""Why an arm does not get to a goal: how far it reaches, or how near inverse kinematics comes."""

from __future__ import annotations

import math

import numpy as np

from ..errors import told_apart
from ..geometry.pose import Pose
from ..robot.arm import Arm
from ..robot.kinematics import CHAIN, PRISMATIC
from .inverse_kinematics import ANGLE_TOLERANCE, POSITION_TOLERANCE, nearest_reached

GUESSES = 8
"""Random starts of inverse kinematics, besides the joints at the start."""


def max_reach(arm: Arm) -> float:
    """Return an upper bound of the distance [m] of the tcp from the first joint; inf for a slide without limits."""
    slides = arm.chain[:-1, CHAIN.kind] == PRISMATIC
    links = np.linalg.norm(arm.chain[1:, CHAIN.offset : CHAIN.kind], axis=1)
    strokes = np.maximum(np.abs(arm.lower), np.abs(arm.upper))[slides]
    return float(links.sum() + strokes.sum())


def why_not_reached(arm: Arm, goal: Pose, start: np.ndarray, *, search: bool = True) -> str:
    """Say in one line why a goal is not reached.

    Args:
        arm: the arm.
        goal: pose of the tcp.
        start: (dof,) joints at the start.
        search: False: without inverse kinematics, which takes some milliseconds.

    Returns:
        The line; "" if there is nothing to say without inverse kinematics.
    """
    base = arm.chain[0, CHAIN.offset : CHAIN.kind]
    away, reach = float(np.linalg.norm(goal.position - base)), max_reach(arm)
    if away > reach:
        one, other = told_apart(away, reach, 2)
        return f"the goal is {one} m from the base, the arm reaches at most {other} m"
    if not search:
        return ""
    rng, low, high = np.random.default_rng(0), np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi)
    guesses = rng.uniform(np.minimum(low, high), high, (GUESSES, arm.dof))
    distance, angle = nearest_reached(arm, goal, [start, *guesses])
    if distance < POSITION_TOLERANCE and angle < ANGLE_TOLERANCE:
        return "the arm reaches the goal, but does not follow the path to it"
    return f"inverse kinematics comes no nearer to the goal than {distance:.3g} m and {angle:.3g} rad"
