"""Why an arm does not get to a goal: how far it reaches, which limit is in its way, or how near it comes."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..errors import told_apart
from ..geometry.pose import Pose
from ..robot.arm import Arm
from ..robot.joint_limits import beyond_limit, near_limit
from ..robot.kinematics import CHAIN, PRISMATIC
from .inverse_kinematics import Reached, nearest_reached

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
        return f"the goal is {one} m from the first joint, {arm.joint_names[0]}; the arm reaches at most {other} m"
    if not search:
        return ""
    rng, low, high = np.random.default_rng(0), np.maximum(arm.lower, -math.pi), np.minimum(arm.upper, math.pi)
    guesses = [start, *rng.uniform(np.minimum(low, high), high, (GUESSES, arm.dof))]
    found = nearest_reached(arm, goal, guesses)
    beyond = [] if found.there else _beyond_limits(arm, goal, guesses)
    if found.there or "" in beyond:
        return "the arm reaches the goal, but does not follow the path to it"
    if beyond:
        return f"within reach, but only beyond a joint limit: {beyond[0]}"
    return _not_turned_so(arm, goal, found) or f"inverse kinematics ends {gap(arm, goal, found.joints)}"


def gap(arm: Arm, goal: Pose, q: np.ndarray) -> str:
    """Return how far the tcp is from a goal, and the joint that is near its limit, in words.

    Args:
        arm: the arm.
        goal: pose of the tcp.
        q: (dof,) joints now.
    """
    distance, angle = arm.fk(q).distance_to(goal)
    near = near_limit(arm, q)
    return f"{distance:.3f} m and {math.degrees(angle):.1f} degrees from the goal{f'; {near}' if near else ''}"


def _beyond_limits(arm: Arm, goal: Pose, guesses: Sequence[np.ndarray]) -> list[str]:
    """Return what limits are exceeded where the goal is reached by joints that turn without limits, the least first.

    A text is "" where the limits are kept after all.
    """
    turns = arm.chain[:-1, CHAIN.kind] != PRISMATIC
    free = replace(arm, lower=np.where(turns, -np.inf, arm.lower), upper=np.where(turns, np.inf, arm.upper))
    ends = (nearest_reached(free, goal, [guess]) for guess in guesses)
    wound = [_wound(arm, end.joints, turns) for end in ends if end.there]
    wound.sort(key=lambda q: -arm.margin(q))
    return [beyond_limit(arm, q) for q in wound]


def _wound(arm: Arm, q: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """Return the same posture with each joint that turns as near to the middle of its limits as whole turns allow."""
    limited = turns & np.isfinite(arm.lower) & np.isfinite(arm.upper)
    middle = q.copy()
    middle[limited] = 0.5 * (arm.lower[limited] + arm.upper[limited])
    return q - 2.0 * math.pi * np.round((q - middle) / (2.0 * math.pi))


def _not_turned_so(arm: Arm, goal: Pose, found: Reached) -> str:
    """Say that only the goal's position is reached; "" if not even that is found to be."""
    place = Pose.from_position_quaternion(goal.position, arm.fk(found.joints).quaternion)
    there = nearest_reached(arm, place, [found.joints])
    if not there.there:
        return ""
    angle = math.degrees(arm.fk(there.joints).distance_to(goal)[1])
    return f"the arm reaches the goal's position, but not its rotation: {angle:.1f} degrees off at the nearest found"
