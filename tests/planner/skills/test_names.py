"""Names: the same thing under two names is found; what is missing is named."""

from __future__ import annotations

import pytest

from onedemo.planner.errors import UnknownName
from onedemo.planner.skills.names import matched_names, plain

KNOWN = ["cubeA", "cubeB", "SquareNut", "peg1", "peg2", "table", "bin1"]


@pytest.mark.parametrize(
    "shown, found",
    [
        ("cubeA", "cubeA"),
        ("cubea", "cubeA"),
        ("SquareNut0", "SquareNut"),
        ("SquareNut_main", "SquareNut"),
        ("square_nut_jnt0", "SquareNut"),
        ("peg1", "peg1"),
        ("peg2", "peg2"),
        ("bin1", "bin1"),
    ],
)
def test_endings_do_not_matter(shown, found):
    assert matched_names([shown], KNOWN) == {shown: found}


def test_what_a_user_says_goes_first():
    assert matched_names(["a", "peg1"], KNOWN, {"a": "cubeA", "peg1": "peg2"}) == {"a": "cubeA", "peg1": "peg2"}


@pytest.mark.parametrize("shown, given", [(["mug"], {}), (["cubeA"], {"cubeA": "mug"})])
def test_unknown_things_are_named_with_what_there_is(shown, given):
    with pytest.raises(UnknownName, match="mug"):
        matched_names(shown, KNOWN, given)


def test_a_name_of_digits_stays_a_name():
    assert plain("12") == "12" and plain("Can0_main") == "can"
