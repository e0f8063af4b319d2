"""Checks of the places given to shelving's `reset(options=...)`."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption, told_apart
from ..core.reset_options import checked_array, checked_poses
from ..scene.scene_objects import TABLE_HEIGHT
from .layout import ShelfLayout
from .parts import BOOK_SIZE, CLUTTER, PITCH, SHELVES, WIDTH
from .places import ShelfPlaces

OPTIONS = ("level", "obstacles", "stand_pose", "cupboard_pose", "slots", "books", "clutter", "joint_positions")
STAND_SHIFT, STAND_LOWER, STAND_HIGHER, STAND_TURN = 0.12, 0.15, 0.10, np.deg2rad(45.0)
"""Largest deviations of a given stand from the nominal one: aside, down, up [m], yaw [rad]."""
CUPBOARD_SHIFT, CUPBOARD_TURN = 0.05, np.deg2rad(20.0)
"""Largest deviations of a given cupboard from the nominal one [m, rad]: it stands on the table, within reach."""
LOWEST_STAND = 1.0
"""Height (z) [m] of the stand's top below which its tube would pierce the plate."""
BOOK_SHIFT = np.array([0.015, 0.03, np.deg2rad(20.0)])
"""Largest deviations of a given book from the middle of the stand, x, y [m] and yaw [rad]: it lies safely, and
fingers fit."""
BESIDE = 0.03
"""Least clearance [m] for a finger beside a released book."""


def given_layout(drawn: ShelfLayout, options: dict[str, Any], places: ShelfPlaces) -> ShelfLayout:
    """Return the drawn layout with the given places.

    Args:
        drawn: layout drawn at random.
        options: options of `reset`.
        places: nominal places of the robot.

    Raises:
        BadOption: stand or cupboard out of reach, off the table or tilted; books off the stand; slots or clutter that
            overlap each other or the cupboard.
    """
    changes: dict[str, Any] = {}
    if "stand_pose" in options:
        lower = min(STAND_LOWER, places.stand[2] - LOWEST_STAND)
        nominal, bounds = (places.stand, places.stand_yaw), (STAND_SHIFT, lower, STAND_HIGHER, STAND_TURN)
        changes["stand"] = _standing("stand_pose", options["stand_pose"], nominal, bounds)
    if "cupboard_pose" in options:
        nominal, bounds = (
            ((*places.cupboard, TABLE_HEIGHT), places.cupboard_yaw),
            (CUPBOARD_SHIFT, 0.001, 0.001, CUPBOARD_TURN),
        )
        changes["cupboard"] = _standing("cupboard_pose", options["cupboard_pose"], nominal, bounds)
    if "slots" in options:
        changes["slots"] = float(checked_array("slots", options["slots"], ()))
    if "books" in options:
        changes["books"] = _lying(options["books"], len(drawn.books))
    if "clutter" in options:
        changes["clutter"] = checked_array("clutter", options["clutter"], (len(CLUTTER), 2))
    layout = replace(drawn, **changes)
    _check_room(layout)
    return layout


def _standing(option: str, value: Any, nominal: tuple[Any, float], bounds: tuple[float, float, float, float]) -> Pose:
    """Return an upright pose, within `bounds` (aside, down, up, yaw) of the nominal place (x, y, z) and yaw."""
    pose = Pose.from_vector(checked_poses(option, [value], 1)[0])
    (x, y, z), yaw = nominal
    aside, lower, higher, turn = bounds
    off = pose.position - (x, y, z)
    if pose.tilt > 0.01:
        raise BadOption(option, "is tilted; only a yaw is possible")
    if np.abs(off[:2]).max() > aside or not -lower <= off[2] <= higher:
        places = f"x {x:g}, y {y:g} by {aside:g} m, z {z - lower:.4g} to {z + higher:.4g}"
        raise BadOption(option, f"{np.round(pose.position, 9).tolist()} is out of reach or not a place; {places}")
    off_by = abs((pose.yaw - yaw + np.pi) % (2.0 * np.pi) - np.pi)
    if off_by > turn:
        digits = len(told_apart(np.degrees(off_by), np.degrees(turn), 0)[0].partition(".")[2])
        given, middle, most = (f"{np.degrees(value):.{digits}f}" for value in (pose.yaw, yaw, turn))
        raise BadOption(option, f"yaw of {given} degrees cannot be reached; allowed: {middle} by {most} degrees")
    return pose


def _lying(value: Any, count: int) -> np.ndarray:
    """Return given places (count, 3) of books on the stand."""
    books = checked_array("books", value, (count, 3))
    for k, off in enumerate(np.abs(books)):
        if (off > BOOK_SHIFT).any():
            x, y, yaw = BOOK_SHIFT
            allowed = f"x by {x:g} m, y by {y:g} m, yaw by {yaw:.4g} rad"
            raise BadOption(
                "books", f"book {k} at {np.round(books[k], 9).tolist()} would not lie on the stand; {allowed}"
            )
    return books


def _check_room(layout: ShelfLayout) -> None:
    """Check that clutter and slots are inside the cupboard and beside each other."""
    if (layout.clutter < 0.0).any():
        raise BadOption("clutter", f"gap {layout.clutter.min():.4g} m is negative: inside the wall or before the front")
    reach = 0.5 * (PITCH * (len(layout.books) - 1) + BOOK_SIZE[1])
    for shelf in SHELVES:
        for side, sign in (("left", 1.0), ("right", -1.0)):
            rows = [k for k, each in enumerate(CLUTTER) if each[:2] == (shelf, side)]
            taken = sum(layout.clutter[k, 0] + CLUTTER[k][2][1] for k in rows)
            room = 0.5 * WIDTH - taken - sign * layout.slots - reach
            if room < BESIDE:
                found, least = told_apart(room, BESIDE, 2)
                reason = f"leave {found} m beside the slots of the {shelf} shelf; {least} m are needed"
                raise BadOption("slots", f"with the clutter on the {side} {reason}")
