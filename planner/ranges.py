"""Ranges of settings: one check, one wording."""

from __future__ import annotations

import re
from collections.abc import Iterable
from functools import cache
from typing import Any

from .errors import BadOption

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
    above = value > low if open_low else value >= low
    below = value < high if open_high else value <= high
    if not (above and below):
        raise BadOption(name, f"{value} is not {words}")


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
