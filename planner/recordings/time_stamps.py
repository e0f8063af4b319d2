"""Seconds from time stamps: their unit is named, or certain, or asked about."""

from __future__ import annotations

import numpy as np

from .recording import SECONDS, Blame

EPOCHS = {"s": 1e9, "ms": 1e12, "us": 1e15, "ns": 1e18}
"""By unit the least stamp since 1970 of a recording after 2001; one after 2286 is ten times as large."""
SLOW, FAST = 2.0, 20_000.0
"""Rates [Hz] between which recordings are made."""


def seconds_of(stamps: np.ndarray, unit: str, blame: Blame) -> tuple[np.ndarray, str]:
    """Return times (n,) [s], and a line that says what the stamps are; times since 1970 count from the first sample on.

    Args:
        stamps: (n,) as recorded, finite.
        unit: "s", "ms", "us" or "ns"; "" if nothing says so.
        blame: makes an error from a reason.

    Raises:
        BadDemonstration: they do not increase, or their unit is not certain.
    """
    steps = np.diff(stamps)
    if (steps <= 0.0).any():
        raise blame(f"does not increase at index {int(np.argmax(steps <= 0.0)) + 1}")
    step = float(np.median(steps)) if len(steps) else 1.0
    epoch = next((each for each, least in EPOCHS.items() if least <= stamps[0] < 10.0 * least), "")
    found = unit or epoch or "s"
    rate = 1.0 / (step * SECONDS[found])
    if not unit and not SLOW <= rate <= FAST:
        likely = [each for each, length in SECONDS.items() if SLOW <= 1.0 / (step * length) <= FAST]
        words = " or ".join(f"{each} ({1.0 / (step * SECONDS[each]):.4g} Hz)" for each in likely) or "s, ms, us or ns"
        raise blame(f"has steps of {step:.6g}, which are no seconds: {words}? say so with --time-unit")
    is_dated = epoch == found
    origin, since = (stamps[0], ", since 1970") if is_dated else (0.0, "")
    return (stamps - origin) * SECONDS[found], f"time stamps are in {found}{since}: {rate:.4g} Hz"
