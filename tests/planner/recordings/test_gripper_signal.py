"""A gripper's command from every kind of signal."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.strategies import for_all, st

from onedemo.planner.errors import BadDemonstration
from onedemo.planner.recordings.gripper_signal import gripper_command
from onedemo.planner.recordings.recording import blame_of

WANTED = np.array([-1.0] * 5 + [1.0] * 6 + [-1.0] * 4)
BLAME = blame_of("x.csv", "grip")


@pytest.mark.parametrize(
    "opened, shut, closed",
    [
        (-1.0, 1.0, None),
        (0.0, 1.0, None),
        (1.0, 0.0, None),
        (0.08, 0.0, None),
        (0.0799, 0.051, None),
        (0.0, 255.0, None),
        (3.0, 210.0, None),
        (1.0, -1.0, -1.0),
        (0.0, 100.0, 100.0),
        (100.0, 0.0, 0.0),
        (-0.7, 0.9, 1.0),
    ],
)
@for_all(st.integers(0, 10**6), max_examples=10)
def test_every_kind_of_signal_is_a_command(opened, shut, closed, seed):
    tremble = 0.02 * (shut - opened) * np.random.default_rng(seed).uniform(-1, 1, len(WANTED))
    values = np.where(WANTED > 0.0, shut, opened) + tremble
    # within the range that names it
    values = np.clip(values, min(opened, shut), max(opened, shut))
    found, said = gripper_command(values, closed, BLAME)
    np.testing.assert_array_equal(found, WANTED)
    assert "\n" not in said


def test_a_signal_that_moves_slowly_changes_once_and_hovering_changes_nothing():
    slow = np.concatenate([np.full(5, 0.08), np.linspace(0.08, 0.0, 21), np.full(5, 0.0)])
    command, _ = gripper_command(slow, None, BLAME)
    assert (np.diff(command) != 0).sum() == 1
    hover = np.concatenate([[-1.0, -1.0, 1.0], 0.1 * np.cos(np.arange(20)), [-1.0]])
    command, _ = gripper_command(hover, None, BLAME)
    np.testing.assert_array_equal(command, [-1.0] * 2 + [1.0] * 21 + [-1.0])
    command, _ = gripper_command(np.concatenate([[-1.0], 0.1 * np.cos(np.arange(20)), [1.0]]), None, BLAME)
    np.testing.assert_array_equal(command, [-1.0] * 21 + [1.0])


def test_zeros_of_a_command_leave_the_gripper_as_it_is():
    command, _ = gripper_command(np.array([0.0, -1.0, 0.0, 1.0, 0.0, 0.0, -1.0, 0.0]), None, BLAME)
    np.testing.assert_array_equal(command, [-1, -1, -1, 1, 1, 1, -1, -1])


@pytest.mark.parametrize("value, closed, state", [(-1.0, None, "open"), (1.0, 1.0, "closed"), (0.04, None, "open")])
def test_a_gripper_that_never_changes_is_said_to(value, closed, state):
    command, said = gripper_command(np.full(6, value), closed, BLAME)
    assert f"counts as {state}" in said
    assert set(command) == {1.0 if state == "closed" else -1.0}


@pytest.mark.parametrize(
    "values, closed, message",
    [
        ([0.0, 50.0, 100.0], None, "is 0 to 100: which value is the closed gripper"),
        ([0.0, 800.0], None, "is 0 to 800: which value"),
        ([-3.0, 3.0], None, "is -3 to 3: which value"),
        ([0.0, 1.0], 0.5, "0.5 lies in the middle"),
    ],
)
def test_other_signals_are_asked_about(values, closed, message):
    with pytest.raises(BadDemonstration, match=message):
        gripper_command(np.array(values), closed, BLAME)
