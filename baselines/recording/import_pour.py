"""Conversion of a person's pouring, recorded as poses of a real Panda's hand without glasses, to a demonstration.

The places of the glasses were not recorded. The source is assumed to be held as in the simulated hand, and the target
to stand where the motion ends: below and in front of the lip at its largest tilts.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...envs.pour.facts import SOURCE, TARGET
from ...envs.pour.geometry import GLASSES, tcp_from_glass
from ...envs.scene.scene_objects import extents
from ...planner import Demonstration, Pose, PosePath, Segment
from ...planner.errors import BadDemonstration, told_apart

PANDA_BASE = (-0.56, 0.0, 0.912)
"""Position of the simulated Panda's base in the world [m]."""
BEHIND_TCP = 0.0064
"""Distance [m] of the grip site behind the tcp that Franka's controller records, along the approach direction."""
POURS = np.deg2rad(92.0)
"""Tilt [rad] above which the lip is assumed to be above the target."""
AHEAD, BELOW = 0.020, 0.015
"""Distances [m] of the target's axis in front of the lip's mean position at these tilts, and of its rim below the lip's
lowest point."""
TURN = np.deg2rad(20.0)
"""Rotation [rad] of the whole recording about the robot's vertical axis, which puts both glasses above the table. Only
the arm's first joint is affected."""


class PlacedDemonstration(NamedTuple):
    """Recording with glasses.

    Attributes:
        demonstration: demonstration with the single segment "carry".
        stands: (2, 3) tops [m] of the stands on which the glasses are placed in the demonstration, source first.
    """

    demonstration: Demonstration
    stands: np.ndarray


def pour_from_poses(recorded: Demonstration) -> PlacedDemonstration:
    """Return the demonstration "carry" of a recording that starts with the source in the hand and ends with it tilted.

    Args:
        recorded: poses of the hand in the robot's base frame; fingers close along y, approach along z.

    Raises:
        BadDemonstration: the glass is never tilted enough to pour.
    """
    turned = Pose.from_yaw([0, 0, 0], TURN)
    quarter = Pose.from_yaw([0.0, 0.0, -BEHIND_TCP], 0.5 * np.pi)
    hand = recorded.path.moved(Pose.from_position_quaternion(PANDA_BASE) @ turned).with_tool(quarter)
    source = hand.with_tool(tcp_from_glass(GLASSES[SOURCE]))
    tilts = np.array([pose.tilt for pose in source])
    if not (tilts > POURS).any():
        most, needed = told_apart(float(np.degrees(tilts.max())), float(np.degrees(POURS)), 0)
        reason = f"the glass is tilted by {most} deg at most; pouring begins at {needed}"
        raise BadDemonstration(recorded.name, "path", reason)
    forward = hand[0].rotation[:, 2] * [1.0, 1.0, 0.0]
    forward /= np.linalg.norm(forward)
    lips = _lips(source, forward)[tilts > POURS]
    rim = np.append((lips.mean(axis=0) + AHEAD * forward)[:2], lips[:, 2].min() - BELOW)
    heights = [glass.height for glass in GLASSES]
    bottoms = np.stack([source[0].position - [0.0, 0.0, 0.5 * heights[SOURCE]], rim - [0.0, 0.0, heights[TARGET]]])
    target = Pose.from_position_quaternion(rim - [0.0, 0.0, 0.5 * heights[TARGET]])
    demonstration = replace(
        recorded,
        task="pour",
        tcp_frame="grip_site",
        path=hand,
        segments=(Segment("carry", 0, len(hand) - 1, "target", target, "source"),),
        object_sizes={glass.name: extents(glass.shape) for glass in GLASSES},
    )
    return PlacedDemonstration(demonstration, bottoms)


def _lips(source: PosePath, forward: np.ndarray) -> np.ndarray:
    """Return the positions (n, 3) [m] of the rim's point that faces forward at the start, along the path."""
    glass = GLASSES[SOURCE]
    side = source[0].rotation.T @ forward
    return source.with_tool(
        Pose.from_position_quaternion([*(glass.radius * side[:2] / np.linalg.norm(side[:2])), 0.5 * glass.height])
    ).positions
