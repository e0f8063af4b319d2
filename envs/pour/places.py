"""Places where each robot pours: stands, start joints and source, as data.

The Panda's places are those of the demonstration. The others were found by the search of `tests/place_study.py`: of
random places and postures those from which most starts of L2 can be poured as demonstrated, with inverse kinematics
along the whole path, 0.08 rad to all joint limits, and no link touching another, the trunk, the stands or the target.
The source fits the gripper.
"""

from __future__ import annotations

from dataclasses import dataclass

from ..scene.robots import Joints
from ..scene.scene_objects import Glass
from .facts import SOURCE
from .geometry import GLASSES

Place = tuple[float, float, float]


@dataclass(frozen=True)
class PourPlaces:
    """Places where a robot pours.

    Attributes:
        stands: nominal x, y, z [m] of the stands' tops, source first.
        ready: start joints [rad]: the hand level, in front of the source.
        source: glass to pour from.
    """

    stands: tuple[Place, Place]
    ready: Joints
    source: Glass


WIDE, SLIM = GLASSES[SOURCE], Glass("source", radius=0.023)
POUR_PLACES: dict[str, PourPlaces | str] = {
    "Panda": PourPlaces(
        ((-0.08, -0.18, 0.95), (0.0, 0.10, 0.95)), (-0.971, 0.844, -0.068, -1.470, 1.031, 1.012, -1.705), WIDE
    ),
    "Baxter": PourPlaces(
        ((-0.123, 0.043, 0.95), (0.143, 0.136, 0.95)), (-0.305, -0.306, 0.109, 1.647, 0.774, 1.664, 0.235), SLIM
    ),
    "Sawyer": PourPlaces(
        ((-0.178, -0.208, 1.05), (0.096, 0.124, 1.05)), (-0.937, -0.212, -0.760, 1.487, 0.708, 2.320, 1.402), SLIM
    ),
    "IIWA": PourPlaces(
        ((-0.047, -0.132, 1.05), (0.144, 0.062, 1.05)), (-1.147, 1.090, 0.277, -1.523, 1.028, 1.633, -2.552), WIDE
    ),
    "Kinova3": PourPlaces(
        ((0.128, 0.045, 0.95), (-0.077, 0.154, 0.95)), (0.820, 1.456, -0.568, 1.208, 2.064, -1.211, -2.226), SLIM
    ),
    "UR5e": PourPlaces(
        ((-0.077, -0.229, 1.05), (0.113, 0.071, 1.05)), (-1.052, -0.562, 0.811, -0.249, -1.052, 1.571), WIDE
    ),
    "XArm7": PourPlaces(
        ((0.080, -0.053, 1.00), (-0.135, 0.165, 1.00)), (-1.249, 0.718, 0.813, 0.963, 1.867, 0.959, 0.206), WIDE
    ),
    "Jaco": PourPlaces(
        ((-0.094, -0.106, 1.00), (-0.161, 0.120, 1.00)), (1.561, 1.798, -0.828, 5.012, 2.293, 4.067, -0.512), SLIM
    ),
}
"""Places by robot, or the reason why a robot has none."""
