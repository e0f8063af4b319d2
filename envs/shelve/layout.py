"""Start layouts of shelving, stand, cupboard, slots and books: ranges as data, seeded."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner import Pose
from ..scene.scene_objects import TABLE_HEIGHT
from .parts import CLUTTER, PITCH, clutter_poses, handed, slot, waiting
from .places import ShelfPlaces

WALL_GAP, FRONT_GAP = 0.002, 0.012
"""Least distances of the clutter to wall or neighbor, and to the cupboard's front [m]."""
MOST_BOOKS = 3


@dataclass(frozen=True, slots=True)
class ShelveRanges:
    """Largest deviations of a layout from the nominal one.

    Attributes:
        stand: largest shift of the stand in x and in y [m].
        lower: largest decrease of the stand's height [m].
        higher: largest increase of the stand's height [m].
        stand_yaw: largest turn of the stand [rad].
        cupboard: largest shift of the cupboard in x and in y [m].
        cupboard_yaw: largest turn of the cupboard [rad].
        slots: largest shift of the three slots along the shelf [m].
        book: largest shift of a book on the stand, in x and in y [m].
        book_yaw: largest turn of a book on the stand [rad].
        clutter: largest shift of each clutter book towards the middle and the back [m].
        joints: largest change of a start joint [rad].
    """

    stand: float = 0.0
    lower: float = 0.0
    higher: float = 0.0
    stand_yaw: float = 0.0
    cupboard: float = 0.0
    cupboard_yaw: float = 0.0
    slots: float = 0.0
    book: float = 0.0
    book_yaw: float = 0.0
    clutter: float = 0.0
    joints: float = 0.0


RANGES = {
    "L0": ShelveRanges(),
    "L1": ShelveRanges(
        0.04, 0.05, 0.025, np.deg2rad(10.0), 0.01, np.deg2rad(5.0), 0.015, 0.003, np.deg2rad(2.0), 0.006, 0.05
    ),
    "L2": ShelveRanges(
        0.08, 0.10, 0.05, np.deg2rad(15.0), 0.02, np.deg2rad(15.0), 0.03, 0.005, np.deg2rad(4.0), 0.01, 0.10
    ),
}
"""Ranges by layout name, see `levels`."""


@dataclass(frozen=True, slots=True)
class ShelfLayout:
    """Layout of a start, in the world.

    Attributes:
        stand: pose of the stand; x along the direction in which a book is taken.
        cupboard: pose of the cupboard.
        pile: x, y of the waiting books [m].
        slots: shift of the middle of the slots along the shelf [m].
        books: (n, 3) x, y [m] and yaw [rad] of each book on the stand, from its nominal place there.
        clutter: (n, 2) gaps of the clutter [m], see `clutter_poses`.
        joints: (n_arms, dof) offsets from the start joints [rad].
    """

    stand: Pose
    cupboard: Pose
    pile: tuple[float, float]
    slots: float
    books: np.ndarray
    clutter: np.ndarray
    joints: np.ndarray

    def handed(self, k: int) -> Pose:
        """Return the pose of book k on the stand."""
        return self.stand @ handed(self.books[k])

    def objects(self) -> np.ndarray:
        """Return the start poses (n, 7): first book on the stand, others piled with the last lowest, then clutter."""
        count = len(self.books)
        poses = [self.handed(0), *(waiting(self.pile, count - 1 - k) for k in range(1, count))]
        poses += [self.cupboard @ pose for pose in clutter_poses(self.clutter)]
        return np.array([pose.vector for pose in poses])

    def furniture(self) -> np.ndarray:
        """Return the poses (3, 7) of cupboard, stand, and the stand's foot."""
        x, y, _ = self.stand.position
        foot = Pose.from_position_quaternion([x, y, TABLE_HEIGHT], self.stand.quaternion)
        return np.array([self.cupboard.vector, self.stand.vector, foot.vector])

    def goals(self, shelf: str) -> np.ndarray:
        """Return the goals (n, 7) of the books on a shelf."""
        count = len(self.books)
        along = self.slots + PITCH * (np.arange(count) - 0.5 * (count - 1))
        return np.array([(self.cupboard @ slot(shelf, each)).vector for each in along])


def shelf_layout(
    rng: np.random.Generator, ranges: ShelveRanges, places: ShelfPlaces, count: int, joints: tuple[int, ...]
) -> ShelfLayout:
    """Draw a layout.

    Args:
        rng: source of randomness.
        ranges: largest deviations from the nominal layout.
        places: nominal places of the robot.
        count: number of books.
        joints: shape (n_arms, dof) of the start joints.
    """
    x, y = places.stand[:2] + rng.uniform(-ranges.stand, ranges.stand, 2)
    z = places.stand[2] + rng.uniform(-ranges.lower, ranges.higher)
    yaw = places.stand_yaw + rng.uniform(-ranges.stand_yaw, ranges.stand_yaw)
    front = places.cupboard + rng.uniform(-ranges.cupboard, ranges.cupboard, 2)
    turned = places.cupboard_yaw + rng.uniform(-ranges.cupboard_yaw, ranges.cupboard_yaw)
    limits = np.array([ranges.book, ranges.book, ranges.book_yaw])
    return ShelfLayout(
        stand=Pose.from_yaw([x, y, z], yaw),
        cupboard=Pose.from_yaw([*front, TABLE_HEIGHT], turned),
        pile=places.pile,
        slots=rng.uniform(-ranges.slots, ranges.slots),
        books=rng.uniform(-limits, limits, (count, 3)),
        clutter=np.array([WALL_GAP, FRONT_GAP]) + rng.uniform(0.0, ranges.clutter, (len(CLUTTER), 2)),
        joints=rng.uniform(-ranges.joints, ranges.joints, joints),
    )
