"""A gripper's command from whatever was recorded of it: a command, an opening, a fraction, counts."""

from __future__ import annotations

import numpy as np

from .recording import Blame

WIDEST = 0.25
"""Largest opening [m] of a gripper; values up to it are meters."""
LATCH = 0.25
"""Share of the range by which a signal must pass its middle to count as changed."""
SLIGHT = 1e-4
"""Range [m] of an opening below which it does not change; of other signals, a share of their usual range."""


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
        (opened, shut), words = ((low, high) if abs(closed - high) < abs(closed - low) else (high, low)), "as said"
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
