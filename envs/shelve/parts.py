"""Cupboard, books and handover stand: sizes, colors and places, independent of the simulator."""

from __future__ import annotations

import numpy as np

from ...planner import Box, Cylinder, Pose
from ..scene.scene_objects import TABLE_HEIGHT, Book, Color, FixedShape, Furniture

BOOK_SIZE = (0.16, 0.035, 0.22)
"""Depth, thickness, height [m] of the books to shelve; 0.3 kg each."""
COLORS: tuple[Color, ...] = ((0.70, 0.16, 0.15, 1.0), (0.13, 0.30, 0.56, 1.0), (0.16, 0.45, 0.26, 1.0))
SHELVES = {"lower": 0.15, "upper": 0.42}
"""Heights of the shelf boards above the table [m]."""
DEPTH, WIDTH, CLEAR = 0.24, 0.52, 0.26
"""Inner depth, width and height of a shelf [m]."""
PITCH = 0.07
"""Distance between slots [m], with clearance for the fingers beside the neighbor."""
INSET = 0.01
"""Distance of a shelved book's spine behind the front edge [m]."""
PLATE = (0.11, 0.10, 0.012)
"""Size of the stand's plate [m]: along the direction in which a book is taken, across, thickness."""
OVERHANG = 0.05
"""Overhang of a book's spine over the stand [m], with clearance for the fingers."""
TURNED = (0.5**0.5, 0.5**0.5, 0.0, 0.0)
"""Rotation (wxyz) of a lying book: its x is unchanged, its back cover is up."""
PILE_YAW = 1.0
WOOD: Color = (0.76, 0.58, 0.39, 1.0)
DARK_WOOD: Color = (0.58, 0.41, 0.26, 1.0)
STEEL: Color = (0.46, 0.48, 0.51, 1.0)
BOARD, SIDE, BACK = 0.010, 0.012, 0.006
"""Thicknesses of shelf boards, side walls and back wall [m]."""
CLUTTER = (
    ("upper", "left", (0.17, 0.042, 0.230), (0.85, 0.62, 0.20, 1.0)),
    ("upper", "left", (0.15, 0.030, 0.200), (0.42, 0.27, 0.47, 1.0)),
    ("upper", "right", (0.16, 0.038, 0.210), (0.15, 0.48, 0.51, 1.0)),
    ("lower", "left", (0.18, 0.050, 0.240), (0.36, 0.24, 0.18, 1.0)),
    ("lower", "right", (0.14, 0.032, 0.190), (0.78, 0.37, 0.20, 1.0)),
)
"""Books already in the cupboard: shelf, side, size [m] and color, from the side wall inwards."""


def books(count: int) -> tuple[Book, ...]:
    """Return the books to shelve, then the clutter."""
    wanted = [Book(f"book{k}", BOOK_SIZE, color) for k, color in enumerate(COLORS[:count])]
    return (*wanted, *(Book(f"clutter{k}", size, color) for k, (*_, size, color) in enumerate(CLUTTER)))


def _board(size: tuple[float, float, float], place: tuple[float, float, float], color: Color = WOOD) -> FixedShape:
    return FixedShape(Box(size), (*place, 1.0, 0.0, 0.0, 0.0), color)


def cupboard() -> Furniture:
    """Return two shelves on a plinth; the frame is at the middle of the front, at table height, x pointing in."""
    middle, wide, foot = 0.5 * DEPTH, WIDTH + 2.0 * SIDE, SHELVES["lower"] - 0.015
    roof = SHELVES["upper"] + CLEAR
    tall, center = roof + BOARD - foot, 0.5 * (roof + BOARD + foot)
    return Furniture(
        "cupboard",
        (
            _board((DEPTH - 0.03, wide - 0.02, foot), (middle + 0.015, 0.0, 0.5 * foot), DARK_WOOD),
            _board((DEPTH, WIDTH, 0.015), (middle, 0.0, foot + 0.0075)),
            _board((DEPTH, WIDTH, BOARD), (middle, 0.0, SHELVES["upper"] - 0.5 * BOARD)),
            _board((DEPTH, WIDTH, BOARD), (middle, 0.0, roof + 0.5 * BOARD)),
            _board((DEPTH, SIDE, tall), (middle, 0.5 * (WIDTH + SIDE), center)),
            _board((DEPTH, SIDE, tall), (middle, -0.5 * (WIDTH + SIDE), center)),
            _board((BACK, wide, tall), (DEPTH + 0.5 * BACK, 0.0, center), DARK_WOOD),
        ),
    )


def stand() -> tuple[Furniture, Furniture]:
    """Return the stand and its foot.

    The stand is a plate on a rod, its frame at the center of the plate's top, x along the direction in which a book is
    taken; the foot has the tube in which the rod slides.
    """
    rod = FixedShape(Cylinder(0.016, 0.238), (0.0, 0.0, -0.131, 1.0, 0.0, 0.0, 0.0), STEEL)
    tube = FixedShape(Cylinder(0.021, 0.18), (0.0, 0.0, 0.09, 1.0, 0.0, 0.0, 0.0), STEEL)
    foot = FixedShape(Cylinder(0.055, 0.012), (0.0, 0.0, 0.006, 1.0, 0.0, 0.0, 0.0), STEEL)
    plate = _board(PLATE, (0.0, 0.0, -0.5 * PLATE[2]), DARK_WOOD)
    return Furniture("stand", (plate, rod)), Furniture("foot", (foot, tube))


def slot(shelf: str, along: float) -> Pose:
    """Return a slot in the cupboard's frame, as the pose of a shelved book.

    Args:
        shelf: "lower" or "upper".
        along: distance to the left of the middle [m].
    """
    height = SHELVES[shelf] + 0.5 * BOOK_SIZE[2]
    return Pose.from_position_quaternion([INSET + 0.5 * BOOK_SIZE[0], along, height])


def handed(offset: np.ndarray) -> Pose:
    """Return a lying book's pose in the stand's frame, for an offset (3,) x, y [m] and yaw [rad] from the middle."""
    middle = 0.5 * (BOOK_SIZE[0] - PLATE[0]) - OVERHANG
    turned = Pose.from_yaw([middle + offset[0], offset[1], 0.5 * BOOK_SIZE[1]], offset[2])
    return turned @ Pose.from_position_quaternion([0, 0, 0], TURNED)


def waiting(pile: tuple[float, float], order: int) -> Pose:
    """Return the world pose of a book in the pile.

    Args:
        pile: x, y of the pile on the table [m].
        order: index of the book, from the bottom.
    """
    height = TABLE_HEIGHT + (order + 0.5) * BOOK_SIZE[1]
    lying = Pose.from_position_quaternion([0, 0, 0], TURNED)
    return Pose.from_yaw([*pile, height], PILE_YAW + 0.12 * order) @ lying


def clutter_poses(gaps: np.ndarray) -> list[Pose]:
    """Return the clutter's poses in the cupboard's frame, for gaps (n, 2) [m] to neighbor or wall and to the front."""
    taken: dict[tuple[str, str], float] = {}
    found = []
    for (shelf, side, size, _), (beside, behind) in zip(CLUTTER, gaps, strict=True):
        edge = taken.get((shelf, side), 0.0) + beside
        taken[shelf, side] = edge + size[1]
        along = 0.5 * WIDTH - edge - 0.5 * size[1]
        place = [behind + 0.5 * size[0], along if side == "left" else -along, SHELVES[shelf] + 0.5 * size[2]]
        found.append(Pose.from_position_quaternion(place))
    return found
