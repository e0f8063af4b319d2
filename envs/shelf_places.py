"""Where each robot shelves: stand, cupboard and start joints, as data.

The places of the Panda are those of the demonstration. Those of the others were found by the search of
`tests/place_study.py`: of random places and postures the ones from which most starts of L2 can be shelved as
demonstrated, by inverse kinematics along the whole way of all three books, 0.08 rad from all joint limits, no link
touching another, the trunk, the table, the pile, the stand or the cupboard.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .robots import Joints


@dataclass(frozen=True)
class ShelfPlaces:
    """Where a robot shelves.

    Attributes:
        stand: nominal middle of the stand's top [m].
        stand_yaw: nominal way in which a book is taken [rad].
        cupboard: nominal middle of the cupboard's front [m].
        cupboard_yaw: nominal way in which a book is inserted [rad].
        ready: joints at the start [rad]: the hand level before the stand, fingers above each other.
    """

    stand: tuple[float, float, float]
    stand_yaw: float
    cupboard: tuple[float, float]
    cupboard_yaw: float
    ready: Joints


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
        (0.25, -0.302, 1.145),
        np.deg2rad(5.5),
        (-0.005, 0.031),
        np.deg2rad(45.0),
        (-1.080, -0.881, 1.932, 2.093, -0.394, -0.002),
    ),
    "IIWA": ShelfPlaces(
        (0.238, -0.157, 1.108),
        np.deg2rad(37.2),
        (0.023, 0.055),
        np.deg2rad(65.3),
        (-1.259, 1.221, 0.655, -1.361, 1.109, 1.149, -0.803),
    ),
    "Kinova3": ShelfPlaces(
        (0.249, -0.187, 1.15),
        np.deg2rad(19.2),
        (-0.078, 0.018),
        np.deg2rad(55.1),
        (1.570, 1.531, -1.473, 1.749, -0.593, 0.188, -0.992),
    ),
}
"""By robot; in place of what is missing the reason. Straight ahead, a Panda cannot insert anything by 20 cm."""
