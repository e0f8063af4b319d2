"""Constraints found in a demonstrated path: which components of an object's rotation are held, and where it is guided.

The rules name no task. All of them look at two things that neither the place of the recording nor the frame of the tool
changes: the direction of gravity as the object sees it, and the point of the object that moves least.
"""

from __future__ import annotations

import math
from functools import partial

import numpy as np
from numpy.typing import ArrayLike

from ..arrays import checked_kind, checked_settings
from ..geometry.pose import PosePath
from ..jit import kernel
from .constraint import MOST_DIRECTIONS, Constraint, ConstraintSettings, angles_to, rotated, seen_up
from .segmentation import resampled

SAMPLES = 200
"""Number of steps of the path that the rules look at: pauses and trembling get no weight."""
STEPS = 200
"""Steps of the search for the center of a cap: the radius is then within 0.5 % of the smallest."""
STILL_LENGTH = 1e-6
"""Path length [m] below which a path shows nothing."""
TURNED = math.radians(15.0)
"""Rotation [rad] below which a path is not said to turn about an axis."""
APART = math.radians(2.0)
"""Angle [rad] between the directions of a curve."""
LEAST_BAND = math.radians(1.0)
"""Deviation [rad] that what is held may always have, whatever the rest of it does."""


def found_constraint(
    path: PosePath, settings: ConstraintSettings | None = None, *, point: ArrayLike = (0.0, 0.0, 0.0)
) -> Constraint:
    """Return what a demonstrated path of a carried object keeps.

    - The object turns about a fixed axis from the first pose on: it is guided from there on.
    - It holds its direction of gravity for a stretch, then turns: it is carried with that direction held (two
      components: upright), and guided from where it begins to turn. If it never turns, it is only carried.
    - It turns all the way: it is carried, and turns as shown and no other way (one component).

    Args:
        path: of the object, or of the hand that holds it.
        settings: see `ConstraintSettings`.
        point: (3,) point of the object whose position counts [m], in the frame of the poses.
    """
    settings = checked_settings(ConstraintSettings, settings)
    count, lengths = len(checked_kind("path", path, PosePath)), path.lengths()
    if count < 2 or lengths[-1] <= STILL_LENGTH:
        return Constraint(count)
    dense = resampled(path, lengths[-1] / SAMPLES)
    up = seen_up(dense)
    keeps = partial(
        Constraint, count, point=np.array(point), position_bound=settings.position, rotation_bound=settings.rotation
    )
    if _turns_about_axis(dense, settings):
        return keeps(guided=0)
    held = _held_until(up, settings)
    if held == 0:
        spread = min(_detour(up), settings.held)
        return keeps(directions=_curve(up), spread=spread, bound=spread + settings.angle)
    center, spread = smallest_cap(up[: held + 1])
    guided = count
    if held < len(up) - 1:
        guided = int(np.searchsorted(lengths, lengths[-1] * held / (len(up) - 1), side="right")) - 1
        guided = min(max(guided, 0), count - 1)
    spread = max(spread, float(angles_to(seen_up(path[: guided + 1]), center).max()))
    return keeps(directions=center[None], spread=spread, bound=spread + settings.angle, guided=guided)


def smallest_cap(directions: np.ndarray) -> tuple[np.ndarray, float]:
    """Return center (3,) and angular radius [rad] of the smallest cap that holds unit vectors (n, 3).

    By steps towards the farthest vector (Badoiu and Clarkson 2003).
    """
    center, best = directions.mean(axis=0), np.empty(3)
    _step_to_cap(np.ascontiguousarray(directions), center, best)
    return best, float(angles_to(directions, best).max())


@kernel
def _step_to_cap(directions, center, best):
    """Move a center towards the farthest of some directions, again and again; the best one is kept."""
    most = -2.0
    for k in range(STEPS):
        length = math.sqrt(center[0] * center[0] + center[1] * center[1] + center[2] * center[2])
        far, least = 0, 2.0
        for d in range(3):
            center[d] /= max(length, 1e-12)
        for i in range(len(directions)):
            cosine = directions[i, 0] * center[0] + directions[i, 1] * center[1] + directions[i, 2] * center[2]
            if cosine < least:
                far, least = i, cosine
        for d in range(3):
            if least > most:
                best[d] = center[d]
            center[d] += (directions[far, d] - center[d]) / (k + 2.0)
        most = max(most, least)


def least_moving_point(path: PosePath) -> tuple[np.ndarray, float]:
    """Return the point (3,) of the poses' frame that moves least, and its largest displacement from its mean [m].

    Where several move equally, as along the axis of a hinge, the one nearest to the frame's origin.
    """
    turns = np.stack([rotated(path, axis) for axis in np.eye(3)], axis=-1)
    mean = turns.mean(axis=0)
    rows, gaps = (turns - mean).reshape(-1, 3), (path.positions.mean(axis=0) - path.positions).reshape(-1)
    point = np.linalg.lstsq(rows, gaps, rcond=1e-2)[0]
    places = path.positions + turns @ point
    return point, float(np.linalg.norm(places - places.mean(axis=0), axis=1).max())


def _turns_about_axis(path: PosePath, settings: ConstraintSettings) -> bool:
    """True if the object turns, and one of its points stays in place: a handle, a door, a tap."""
    turned = 2.0 * np.arccos(np.clip(np.abs(path.quaternions @ path.quaternions[0]), 0.0, 1.0)).max()
    return turned > TURNED and least_moving_point(path)[1] <= settings.axis


def _held_until(up: np.ndarray, settings: ConstraintSettings) -> int:
    """Index of the last sample up to which the direction of gravity is held; 0: it turns from the beginning."""
    low, high, last = 0, len(up), len(up) - 1
    while high - low > 1:  # the cap of a longer stretch is no smaller
        middle = (low + high) // 2
        low, high = (middle, high) if smallest_cap(up[: middle + 1])[1] <= settings.held else (low, middle)
    if low == last:
        return last
    if low == 0:
        return 0
    center = np.median(up[: low + 1], axis=0)
    away = angles_to(up, center / np.linalg.norm(center))
    usual = max(2.0 * float(np.median(away[: low + 1])), LEAST_BAND)
    end = low
    while end > 0 and away[end] > usual:
        end -= 1
    if end < settings.least * last:
        return 0
    inside = angles_to(up[: end + 1], up[0]).max() / end
    outside = angles_to(up[end:], up[end]).max() / (last - end)
    return end if inside < settings.slower * outside else 0


def _detour(up: np.ndarray) -> float:
    """Largest angle [rad] of the vertical's curve from the shortest turn between its ends: so freely it was turned."""
    ends = up[[0, -1]] / np.linalg.norm(up[[0, -1]], axis=1, keepdims=True)
    shares = np.linspace(0.0, 1.0, len(up))[:, None]
    turn = (1.0 - shares) * ends[0] + shares * ends[1]
    lengths = np.linalg.norm(turn, axis=1, keepdims=True)
    if lengths.min() < 1e-6:
        return math.inf
    turn = turn / lengths
    return float(np.min([angles_to(up, each) for each in turn], axis=0).max())


def _curve(up: np.ndarray) -> np.ndarray:
    """Return the directions (m, 3), at steps of an angle, of the curve that the vertical moves along."""
    apart = max(APART, float(angles_to(up[1:], up[:-1]).sum()) / (MOST_DIRECTIONS - 2))
    kept = [up[0]]
    for each in up[1:]:
        if angles_to(each, kept[-1]) > apart:
            kept.append(each)
    return np.array([*kept, up[-1]])
