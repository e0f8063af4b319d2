"""Ranges of settings: one check, one wording."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from numbers import Integral
from typing import Any

from .errors import BadOption

MAX_TICKS = 1_000_000
"""Largest number of ticks of a motion: there is a row of joints for each."""
FORM = re.compile(r"([\[(])(\S+), (\S+)([\])])")


def check_ranges(settings: object, interval: str, *names: str) -> None:
    """Refuse attributes outside an interval.

    Args:
        settings: an object with these attributes.
        interval: in the notation of mathematics: "(0, inf)", "[0, 1]".
        names: of the attributes.

    Raises:
        BadOption: an attribute is outside the interval, or NaN.
    """
    for name in names:
        check_range(name, getattr(settings, name), interval)


def check_range(name: str, value: Any, interval: str) -> None:
    """Refuse a number outside an interval.

    Args:
        name: of the number, for the message.
        value: the number.
        interval: in the notation of mathematics: "(0, inf)", "[0, 1]".

    Raises:
        BadOption: the number is outside the interval, or NaN.
    """
    low, high, open_low, open_high, words = _parsed(interval)
    try:
        above = value > low if open_low else value >= low
        below = value < high if open_high else value <= high
        inside = bool(above and below)
    except (TypeError, ValueError):
        raise BadOption(name, f"{value!r} is not a number") from None
    if not inside:
        raise BadOption(name, f"{value} is not {words}")


def check_counts(settings: object, interval: str, *names: str) -> None:
    """Refuse attributes that are no whole numbers in an interval.

    Args:
        settings: an object with these attributes.
        interval: see `check_ranges`.
        names: of the attributes.

    Raises:
        BadOption: an attribute is not a whole number, or outside the interval.
    """
    for name in names:
        check_count(name, getattr(settings, name), interval)


def check_count(name: str, value: Any, interval: str) -> None:
    """Refuse what is no whole number in an interval.

    Args:
        name: of the number, for the message.
        value: the number.
        interval: see `check_range`.

    Raises:
        BadOption: the number is not whole, or outside the interval.
    """
    if not isinstance(value, Integral):
        raise BadOption(name, f"{value!r} is not a whole number")
    check_range(name, value, interval)


def ticks_of(seconds: float, dt: float) -> int:
    """Return the number of ticks in a time.

    Args:
        seconds: the time.
        dt: seconds per tick.

    Raises:
        BadOption: there are more than `MAX_TICKS`.
    """
    if not seconds / dt <= MAX_TICKS:
        raise BadOption("dt", f"{seconds:g} s are {seconds / dt:.3g} ticks of {dt:g} s; allowed are {MAX_TICKS}")
    return round(seconds / dt)


def check_choice(name: str, value: object, known: Iterable[str]) -> None:
    """Refuse a word that is not among the known ones.

    Args:
        name: of the option, for the message.
        value: the word.
        known: the words.

    Raises:
        BadOption: the word is unknown.
    """
    words = tuple(known)
    if value not in words:
        raise BadOption(name, f"{value!r} is not one of {', '.join(word or repr(word) for word in words)}")


@cache
def _parsed(interval: str) -> tuple[float, float, bool, bool, str]:
    found = FORM.fullmatch(interval)
    assert found, interval
    left, low, high, right = found.groups()
    ends = float(low), float(high), left == "(", right == ")"
    if low == "0" and high == "inf":
        return *ends, "a positive number" if left == "(" else "a number >= 0"
    if left == "[" and right == "]":
        return *ends, f"from {low} to {high}"
    if low == "0" and left == "(" and high != "1":
        return *ends, f"a positive number {'below' if right == ')' else 'up to'} {high}"
    return *ends, f"in {interval}"
