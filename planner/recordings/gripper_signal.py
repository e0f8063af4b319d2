"""A gripper's command from whatever was recorded of it: a command, an opening, a fraction, counts."""

from __future__ import annotations

import re
from collections.abc import Iterable

import numpy as np

from ..geometry.pose import PosePath
from .recording import Blame

WIDEST = 0.25
"""Largest opening [m] of a gripper; values up to it are meters."""
LATCH = 0.25
"""Share of the range by which a signal must pass its middle to count as changed."""
SLIGHT = 1e-4
"""Range [m] of an opening below which it does not change; of other signals, a share of their usual range."""
CARRIED, RIGID = 0.03, 0.2
"""Way [m] of an object along with the hand from which on it tells whether the gripper is closed, and by which share of
a step it may move in the hand meanwhile."""
SURE = 0.8
"""Share of that way with the gripper closed that confirms the reading; with so much of it open it is wrong."""
VAGUE = {"joint", "position", "pos", "angle", "knuckle", "state", "value", "q"}
"""Words of a gripper's column that say neither what is large when it is open nor when it is closed."""

COMMANDS = {"command", "cmd", "grasp", "close"}
"""Words of a command, whose 1 closes."""


def closed_share(command: np.ndarray, hand: PosePath, objects: Iterable[PosePath]) -> float | None:
    """Return the share with a closed gripper of the way that objects move along with the hand; None if they do not.

    Args:
        command: (n,), 1 closed and -1 open.
        hand: n poses of the hand.
        objects: n poses of each object.
    """
    way = closed = 0.0
    for path in objects:
        steps = np.linalg.norm(np.diff(path.positions, axis=0), axis=1)
        inside = np.array([(one.inverse() @ other).position for one, other in zip(hand, path, strict=True)])
        slips = np.linalg.norm(np.diff(inside, axis=0), axis=1)
        carried = (steps > SLIGHT) & (slips < RIGID * steps)
        way += float(steps[carried].sum())
        closed += float(steps[carried & (command[:-1] > 0.0)].sum())
    return closed / way if way > CARRIED else None


def check_sense(values: np.ndarray, name: str, is_named: bool, share: float | None, blame: Blame) -> None:
    """Refuse a reading of a gripper that carried objects contradict, or that neither they nor its name decide.

    Args:
        values: (n,) as recorded.
        name: of the column.
        is_named: the name says which values are of the open gripper, or its unit does.
        share: of the way of carried objects with the gripper closed, see `closed_share`.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: one line says why.
    """
    low, high, first = float(values.min()), float(values.max()), float(values[0])
    say = f"say so with --gripper-closed {low:g} or {high:g}"
    if high - low <= SLIGHT * max(1.0, abs(high)):
        return
    if share is not None and share <= 1.0 - SURE:
        raise blame(f"is {low:g} to {high:g}, and objects move with the hand where it would be open: {say}")
    if is_named or low < 0.0 or (share is not None and share >= SURE):
        return
    words = set(re.split(r"[\W_]+", name.lower()))
    if high <= WIDEST and VAGUE & words:
        raise blame(f"is {low:g} to {high:g}: an opening [m], or an angle that closes it? {say}")
    is_fraction, is_high = WIDEST < high <= 1.0, first - low > high - first
    # one that changes once either takes something, or held it from the start
    is_once = (
        is_fraction
        and not COMMANDS & words
        and int(np.sum(np.diff(_latched((values - low) / (high - low))) != 0.0)) == 1
    )
    if is_once or (is_high and (is_fraction or 100.0 < high <= 255.0)):
        raise blame(f"is {low:g} to {high:g}, at first {first:g}: is it open then, or closed? {say}")


def gripper_command(values: np.ndarray, closed: float | None, blame: Blame) -> tuple[np.ndarray, str]:
    """Return the command (n,), 1 to close and -1 to open, and a line that says how it was understood.

    Known are -1 to 1 (1 closes), 0 to 1 (open at first), up to 0.25 (an opening in meters) and 0 to 255 (255 is
    closed). Between two samples nearer to the middle than a quarter of the range the command does not change.

    Args:
        values: (n,) as recorded, finite.
        closed: value of the closed gripper; None if nothing says so.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: the values are in no known range, and nothing says which are closed.
    """
    low, high = float(values.min()), float(values.max())
    if high - low <= SLIGHT * max(1.0, abs(high)):
        shut = closed is not None and abs(closed - low) <= SLIGHT * max(1.0, abs(closed))
        shut = shut or (closed is None and low == 1.0)
        state = "closed" if shut else "open"
        return np.full(len(values), 1.0 if shut else -1.0), f"the gripper stays at {low:g}; it counts as {state}"
    if closed is None:
        (opened, shut), words = _ends(values, blame)
    elif abs(closed - low) == abs(closed - high):
        raise blame(f"is {low:g} to {high:g}: {closed:g} lies in the middle, and says not which end is closed")
    else:
        (opened, shut), words = ((low, high) if abs(closed - high) < abs(closed - low) else (high, low)), "said"
    share = (values - opened) / (shut - opened)
    return _latched(share), f"the gripper's {low:g} to {high:g} are read as {words}: closed at {shut:g}"


def _ends(values: np.ndarray, blame: Blame) -> tuple[tuple[float, float], str]:
    """Return the values of the open and of the closed gripper, and in words why."""
    low, high = float(values.min()), float(values.max())
    if low < 0.0 and low >= -1.0 and high <= 1.0:
        return (-1.0, 1.0), "a command"
    if low >= 0.0 and high <= WIDEST:
        return (high, low), "an opening [m]"
    if low >= 0.0 and high <= 1.0:
        first = float(values[0])
        return ((low, high) if first - low <= high - first else (high, low)), "a fraction, open at first"
    if low >= 0.0 and 100.0 < high <= 255.0:
        return (0.0, 255.0), "counts up to 255"
    raise blame(f"is {low:g} to {high:g}: which value is the closed gripper? say so with --gripper-closed")


def _latched(share: np.ndarray) -> np.ndarray:
    """Return the command (n,) of a signal (n,), 0 open and 1 closed, that passes its middle clearly."""
    out, state = np.empty(len(share)), 1.0 if share[0] > 0.5 else -1.0
    for k, value in enumerate(share):
        if state < 0.0 and value > 0.5 + 0.5 * LATCH:
            state = 1.0
        elif state > 0.0 and value < 0.5 - 0.5 * LATCH:
            state = -1.0
        out[k] = state
    return out
