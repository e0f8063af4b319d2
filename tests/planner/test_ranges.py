"""One check of ranges, one wording; NaN is in none."""

from __future__ import annotations

import math
from types import SimpleNamespace

import pytest

from onedemo.planner.errors import BadOption
from onedemo.planner.ranges import check_choice, check_range, check_ranges


@pytest.mark.parametrize(
    "interval, inside, outside, words",
    [
        ("(0, inf)", [1e-300, 3, 1e300], [0.0, -1.0, math.inf, math.nan], "a positive number"),
        ("(0, inf]", [math.inf], [0.0, math.nan], "a positive number"),
        ("[0, inf)", [0.0, 7], [-1e-300, math.inf, math.nan], "a number >= 0"),
        ("[0, 1]", [0, 1], [-1e-9, 1.0 + 1e-9, math.nan], "from 0 to 1"),
        ("(0, 1]", [1e-9, 1], [0, 1.1, math.nan], r"in \(0, 1\]"),
        ("[0, 1)", [0, 0.9], [1, -1, math.nan], r"in \[0, 1\)"),
        ("(0, 10]", [10], [0, 10.1], "a positive number up to 10"),
        ("(0, 3600)", [1], [3600, 0], "a positive number below 3600"),
    ],
)
def test_numbers_are_inside_or_refused_in_words(interval, inside, outside, words):
    for value in inside:
        check_range("x", value, interval)
        check_ranges(SimpleNamespace(x=value, y=value), interval, "x", "y")
    for value in outside:
        with pytest.raises(BadOption, match=f"option 'x': .* is not {words}$"):
            check_range("x", value, interval)
        with pytest.raises(BadOption, match="option 'y'"):
            check_ranges(SimpleNamespace(x=inside[0], y=value), interval, "x", "y")


def test_words_are_known_or_refused_with_those_that_are():
    check_choice("law", "log", ("log", "paper"))
    with pytest.raises(BadOption, match="option 'law': 'lag' is not one of log, paper"):
        check_choice("law", "lag", ("log", "paper"))
