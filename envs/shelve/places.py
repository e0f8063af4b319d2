"""Places where each robot shelves: stand, cupboard and start joints, as data.

The Panda's places are those of the demonstration. The others were found by the search of `tests/place_study.py`: of
random places and postures those from which most starts of L2 can be shelved as demonstrated, with inverse kinematics
along the whole path of all three books, 0.08 rad to all joint limits, and no link touching another, the trunk, the
table, the pile, the stand or the cupboard.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..scene.robots import Joints


@dataclass(frozen=True)
class ShelfPlaces:
    """Places where a robot shelves.

    Attributes:
        stand: nominal center of the stand's top [m].
        stand_yaw: nominal direction in which a book is taken [rad].
        cupboard: nominal x, y of the middle of the cupboard's front [m].
        cupboard_yaw: nominal direction in which a book is inserted [rad].
        ready: start joints [rad]: the hand level in front of the stand, fingers above each other.
        pile: x, y of the waiting books on the table [m], clear of the arm.
    """

    stand: tuple[float, float, float]
    stand_yaw: float
    cupboard: tuple[float, float]
    cupboard_yaw: float
    ready: Joints
    pile: tuple[float, float] = (-0.21, -0.27)


SHELF_PLACES: dict[str, ShelfPlaces | str] = {
    "Panda": ShelfPlaces(
        (0.15, -0.30, 1.15),
        np.deg2rad(30.0),
        (-0.009, 0.116),
        np.deg2rad(75.0),
        (-0.435, 0.580, -0.670, -1.869, 1.843, 1.350, 0.048),
    ),
    "Baxter": ShelfPlaces(
        (0.145, -0.299, 1.125),
        np.deg2rad(13.5),
        (-0.096, 0.092),
        np.deg2rad(85.5),
        (-1.150, -0.541, 0.607, 2.081, 1.220, 1.116, 1.842),
    ),
    "Sawyer": ShelfPlaces(
        (0.152, -0.264, 1.111),
        np.deg2rad(32.9),
        (-0.178, 0.045),
        np.deg2rad(49.5),
        (2.094, -2.612, -2.221, 0.946, -2.239, -0.920, 1.584),
    ),
    "UR5e": ShelfPlaces(
        (-0.092, -0.208, 1.1),
        np.deg2rad(49.66),
        (-0.061, 0.050),
        np.deg2rad(57.61),
        (-1.525, -0.644, 1.565, -4.064, 0.820, 0.001),
        pile=(0.24, -0.28),
    ),
    "IIWA": ShelfPlaces(
        (0.098, -0.191, 1.168),
        np.deg2rad(43.43),
        (0.066, 0.036),
        np.deg2rad(57.18),
        (-1.403, 1.062, 0.533, -1.389, 1.029, 1.472, -0.714),
    ),
    "Jaco": ShelfPlaces(
        (-0.101, 0.064, 1.164),
        np.deg2rad(51.53),
        (0.144, -0.089),
        np.deg2rad(4.87),
        (-1.223, 4.832, 1.437, 5.298, 0.247, 2.450, -0.281),
    ),
    "Kinova3": "its wrist, of 13 Nm, follows so softly that it pushed or dropped books in 3 of 6 episodes",
    "XArm7": "from the best places found, its hand drags a released book along in 2 of 4 episodes",
}
"""Places by robot, or the reason why a robot has none. Straight ahead, a Panda cannot insert anything by 20 cm."""
