"""One check of what is handed in: the array itself where it is fit, a fit copy where it can be, else one line."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.planner.arrays import broadcast_shape, check_capacity, checked_array, checked_items, checked_kind, numbers
from onedemo.planner.errors import BadOption, BadShape, NotFinite, OneDemoError, WrongType, told_apart

FIT = np.arange(12.0).reshape(3, 4)


def test_what_is_fit_is_not_copied():
    assert checked_array("x", FIT, (3, 4)) is FIT and checked_array("x", FIT, (None, None)) is FIT
    assert numbers("x", FIT) is FIT
    items = ("a", "b")
    assert checked_items("x", items, str) is items


@pytest.mark.parametrize(
    "unusual",
    [FIT.astype(np.float32), FIT.astype(int), FIT.astype(">f8"), np.asfortranarray(FIT), FIT.tolist(),
     np.repeat(FIT, 2, 0)[::2], FIT > 3.0],
)  # fmt: skip
def test_what_can_be_used_is_made_fit_for_kernels(unusual):
    array = checked_array("x", unusual, (3, 4))
    assert array.dtype == np.float64 and array.flags.carray
    np.testing.assert_array_equal(array, np.array(unusual, dtype=float))


def test_a_read_only_array_is_copied_so_that_kernels_are_compiled_once():
    locked = FIT.copy()
    locked.flags.writeable = False
    assert checked_array("x", locked, (3, 4)).flags.writeable and not locked.flags.writeable


@pytest.mark.parametrize(
    "value, error, message",
    [
        (np.zeros((2, 4)), BadShape, "speeds has shape (2, 4); expected (3, 4)"),
        (np.zeros(4), BadShape, "speeds has shape (4,); expected (3, 4)"),
        (np.where(FIT == 6.0, np.nan, FIT), NotFinite, "speeds holds a value that is not finite at index (1, 2)"),
        (None, WrongType, "speeds is None; expected an array of numbers"),
        ("fast", WrongType, "speeds is 'fast', a str; expected an array of numbers"),
        ([[1.0], [1.0, 2.0]], WrongType, "speeds is [[1.0], [1.0, 2.0]], a list; expected an array of numbers"),
        (FIT + 1j, WrongType, "speeds is a ndarray; expected an array of numbers"),
        (np.ma.masked_equal(FIT, 5.0), WrongType,
         "speeds is a MaskedArray; expected an array of numbers, none of them masked"),
    ],
)  # fmt: skip
def test_what_cannot_be_used_is_refused_in_one_line(value, error, message):
    with pytest.raises(error) as caught:
        checked_array("speeds", value, (3, 4))
    assert str(caught.value) == message and isinstance(caught.value, OneDemoError)


def test_infinite_numbers_are_let_through_on_request():
    assert np.isinf(checked_array("x", [np.inf], (1,), finite=False)).all()


def test_shapes_kinds_and_numbers_of_things():
    assert broadcast_shape("a and b", (3, 1), (4,)) == (3, 4)
    with pytest.raises(BadShape, match="a and b"):
        broadcast_shape("a and b", (3,), (4,))
    with pytest.raises(WrongType, match=r"x\[1\] is 2, a int; expected a str"):
        checked_items("x", ["a", 2], str)
    for none in ("abc", 3):
        with pytest.raises(WrongType, match="expected a sequence of str"):
            checked_items("x", none, str)
    with pytest.raises(WrongType, match="expected an OSError"):
        checked_kind("x", "a", OSError)
    check_capacity("x", 3, 3)
    with pytest.raises(BadOption, match="there are 4; allowed are 3"):
        check_capacity("x", 4, 3)


@pytest.mark.parametrize(
    "one, other, words",
    [
        (5.2, 0.9, ("5.2", "0.9")),
        (10.04, 10.0, ("10.04", "10.00")),
        (9.9996, 10.0, ("9.9996", "10.0000")),
        (1, 1, None),
    ],
)
def test_numbers_in_a_message_are_told_apart(one, other, words):
    found = told_apart(one, other, 1)
    assert found == words if words else found[0] == found[1]
