"""The glasses, their stands, and the forward pour: how a hand holds a glass and where it must be to pour.

The approach is level; pouring tilts the glass about the axis along which the fingers close, so that the hand ends
above the glass and points down. A tcp has the closing axis as x, up as y and the approach as z.
"""

from __future__ import annotations

import numpy as np

from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Cylinder
from ..scene.scene_objects import Beads, Color, FixedShape, Furniture, Glass

SOURCE, TARGET = 0, 1
"""Indices of the two glasses."""
GLASSES = (Glass("source", radius=0.030), Glass("target", radius=0.043))
"""What the Panda pours from and into; other grippers may need another source, see `pour_places`."""
BEADS = Beads()
PLATE_RADIUS, PLATE, COLUMN_RADIUS, COLUMN = 0.05, 0.012, 0.022, 0.6
"""A stand's plate and column [m]; what of the column is too long is hidden in and below the table."""
WOOD: Color = (0.42, 0.27, 0.16, 1.0)
METAL: Color = (0.32, 0.33, 0.36, 1.0)
GRASP_HEIGHT = 0.055
"""Of the fingers above the glass's bottom [m]."""
AHEAD = 0.002
"""The glass's axis in front of the tcp [m]: still between the pads, and the palm does not touch."""
BEHIND, ABOVE = 0.028, 0.020
"""The pour point: where the lip is while pouring, behind the target's axis and above its rim [m]."""
BACK, UP = 0.060, 0.080
"""How far the upright glass's lip is behind and above the pour point before pouring [m]."""
TILTED = np.deg2rad(115.0)
"""Tilt at the end of pouring."""


def stand(name: str) -> Furniture:
    """What a glass stands on; its frame is in the middle of its top."""
    plate = FixedShape(Cylinder(PLATE_RADIUS, PLATE), (0.0, 0.0, -0.5 * PLATE, 1.0, 0.0, 0.0, 0.0), WOOD)
    middle = (0.0, 0.0, -PLATE - 0.5 * COLUMN, 1.0, 0.0, 0.0, 0.0)
    return Furniture(f"{name}_stand", (plate, FixedShape(Cylinder(COLUMN_RADIUS, COLUMN), middle, METAL)))


STANDS = tuple(stand(glass.name) for glass in GLASSES)


def level_hand(position: np.ndarray, yaw: float) -> Pose:
    """A tcp at a position (3,) [m] that approaches level in the direction `yaw` [rad]."""
    half = 0.5 * (yaw + 0.5 * np.pi)
    upright = Pose.from_position_quaternion(position, [np.cos(half), 0.0, 0.0, np.sin(half)])
    return upright @ Pose.from_position_quaternion([0, 0, 0], [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])


def tcp_from_glass(glass: Glass) -> Pose:
    """How a glass is held."""
    return grasp(glass, np.zeros(3), -0.5 * np.pi).inverse()


def grasp(glass: Glass, center: np.ndarray, yaw: float) -> Pose:
    """The tcp that holds an upright glass at a center (3,) [m] from the direction `yaw`."""
    back = AHEAD * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return level_hand(center - back + [0.0, 0.0, GRASP_HEIGHT - 0.5 * glass.height], yaw)


def pouring(glass: Glass, rim: np.ndarray, yaw: float, tilt: float, back: float = 0.0, up: float = 0.0) -> Pose:
    """The tcp that holds a glass so that its lip is at the pour point of a rim.

    Args:
        glass: in the hand.
        rim: (3,) middle of the target's rim [m].
        yaw: direction of pouring [rad].
        tilt: of the glass towards it [rad].
        back: how far the lip is behind the pour point [m].
        up: how far above it [m].
    """
    forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    lip = rim - (BEHIND + back) * forward + [0.0, 0.0, ABOVE + up]
    turned = Pose.from_position_quaternion([0, 0, 0], [np.cos(0.5 * tilt), np.sin(0.5 * tilt), 0.0, 0.0])
    tcp_from_lip = Pose.from_position_quaternion([0.0, glass.height - GRASP_HEIGHT, AHEAD + glass.radius])
    return level_hand(lip, yaw) @ turned @ tcp_from_lip.inverse()
