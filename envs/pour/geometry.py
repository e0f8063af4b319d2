"""Glasses, their stands and the forward pour: poses of the hand to hold a glass and to pour.

The approach is level; pouring tilts the glass about the axis along which the fingers close, so that the hand ends above
the glass and points down. The tcp's x is the closing axis, its y points up, its z is the approach direction.
"""

from __future__ import annotations

import numpy as np

from ...planner import Cylinder, Pose
from ..scene.scene_objects import Beads, Color, FixedShape, Furniture, Glass

GLASSES = (Glass("source", radius=0.030), Glass("target", radius=0.043))
"""Glasses that the Panda pours from and into; other grippers may need another source, see `places`."""
BEADS = Beads()
PLATE_RADIUS, PLATE, COLUMN_RADIUS, COLUMN = 0.05, 0.012, 0.022, 0.6
"""Sizes of a stand's plate and column [m]; the column's excess length is hidden in and below the table."""
WOOD: Color = (0.42, 0.27, 0.16, 1.0)
METAL: Color = (0.32, 0.33, 0.36, 1.0)
GRASP_HEIGHT = 0.055
"""Height of the fingers above the glass's bottom [m]."""
AHEAD = 0.002
"""Distance [m] of the glass's axis in front of the tcp: still between the pads, and clear of the palm."""
BEHIND, ABOVE = 0.028, 0.020
"""Pour point, the lip's position while pouring: distance behind the target's axis and above its rim [m]."""
BACK, UP = 0.060, 0.080
"""Distances of the upright glass's lip behind and above the pour point before pouring [m]."""
TILTED = np.deg2rad(115.0)
"""Tilt at the end of pouring [rad]."""


def stand(name: str) -> Furniture:
    """Return the stand of a glass; its frame is at the center of its top."""
    plate = FixedShape(Cylinder(PLATE_RADIUS, PLATE), (0.0, 0.0, -0.5 * PLATE, 1.0, 0.0, 0.0, 0.0), WOOD)
    middle = (0.0, 0.0, -PLATE - 0.5 * COLUMN, 1.0, 0.0, 0.0, 0.0)
    return Furniture(f"{name}_stand", (plate, FixedShape(Cylinder(COLUMN_RADIUS, COLUMN), middle, METAL)))


STANDS = tuple(stand(glass.name) for glass in GLASSES)


def level_hand(position: np.ndarray, yaw: float) -> Pose:
    """Return a level tcp pose.

    Args:
        position: (3,) position of the tcp [m].
        yaw: approach direction [rad].
    """
    half = 0.5 * (yaw + 0.5 * np.pi)
    upright = Pose.from_position_quaternion(position, [np.cos(half), 0.0, 0.0, np.sin(half)])
    return upright @ Pose.from_position_quaternion([0, 0, 0], [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])


def tcp_from_glass(glass: Glass) -> Pose:
    """Return the pose of a held glass in the tcp frame."""
    return grasp(glass, np.zeros(3), -0.5 * np.pi).inverse()


def grasp(glass: Glass, center: np.ndarray, yaw: float) -> Pose:
    """Return the tcp pose that holds an upright glass.

    Args:
        glass: glass to hold.
        center: (3,) center of the glass [m].
        yaw: approach direction [rad].
    """
    back = AHEAD * np.array([np.cos(yaw), np.sin(yaw), 0.0])
    return level_hand(center - back + [0.0, 0.0, GRASP_HEIGHT - 0.5 * glass.height], yaw)


def pouring(glass: Glass, rim: np.ndarray, yaw: float, tilt: float, back: float = 0.0, up: float = 0.0) -> Pose:
    """Return the tcp pose that holds a glass with its lip at the pour point of a rim.

    Args:
        glass: glass in the hand.
        rim: (3,) center of the target's rim [m].
        yaw: direction of pouring [rad].
        tilt: tilt of the glass in this direction [rad].
        back: distance of the lip behind the pour point [m].
        up: distance of the lip above the pour point [m].
    """
    forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    lip = rim - (BEHIND + back) * forward + [0.0, 0.0, ABOVE + up]
    turned = Pose.from_position_quaternion([0, 0, 0], [np.cos(0.5 * tilt), np.sin(0.5 * tilt), 0.0, 0.0])
    tcp_from_lip = Pose.from_position_quaternion([0.0, glass.height - GRASP_HEIGHT, AHEAD + glass.radius])
    return level_hand(lip, yaw) @ turned @ tcp_from_lip.inverse()
