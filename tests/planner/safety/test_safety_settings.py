"""Settings of the safety layer and calls of it that are refused by name."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.planner.guarded_point import BALL, DT, gantry, point_among
from soak import (
    TALLY,
)

from onedemo.planner.errors import BadModel, BadOption, BadShape, NotFinite, WrongType
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.safety_layer import (
    SafetyLayer,
    SafetySettings,
)

# ------------------------------------------------------------------ bad input


@pytest.mark.parametrize("name", ["alpha", "shell", "limit_gain", "rotation_weight", "rest_weight", "acceleration"])
@pytest.mark.parametrize("bad", [0.0, -1.0, np.nan, np.inf])
def test_rates_must_be_positive(name, bad):
    with pytest.raises(BadOption, match=f"{name}.*positive"):
        SafetySettings(**{name: bad})


@pytest.mark.parametrize("name", ["distance", "self_distance", "buffer", "lead"])
@pytest.mark.parametrize("bad", [-1e-9, np.nan, np.inf])
def test_distances_must_not_be_negative(name, bad):
    with pytest.raises(BadOption, match=name):
        SafetySettings(**{name: bad})


@pytest.mark.parametrize(
    "change, name",
    [
        ({"decay": 0.0}, "decay"),
        ({"decay": 1.1}, "decay"),
        ({"decay": np.nan}, "decay"),
        ({"halvings": 0}, "halvings"),
        ({"halvings": 31}, "halvings"),
        ({"shell": 0.01}, "shell.*distance"),
        ({"self_distance": 0.06}, "shell"),
    ],
)
def test_settings_that_contradict_each_other_are_refused(change, name):
    with pytest.raises(BadOption, match=name):
        SafetySettings(**change)


def test_bad_calls_are_refused_by_name():
    for dt in (0.0, -1.0, np.nan, np.inf):
        with pytest.raises(BadOption, match="dt"):
            point_among([], dt)
    layer = point_among([])
    with pytest.raises(BadShape, match=r"safety: q.*\(3,\)"):
        layer(np.zeros(7), np.zeros(3))
    with pytest.raises(BadShape, match="safety: velocity"):
        layer(np.zeros(3), np.zeros((1, 3)))
    with pytest.raises(NotFinite, match=r"safety: q .* at index 1"):
        layer([0.0, np.nan, 0.0], np.zeros(3))
    with pytest.raises(BadOption, match="3 arms"):
        SafetyLayer([gantry()] * 3, [BALL] * 3, [], DT)
    with pytest.raises(BadModel, match="robot: bodies: there are 2 for 1 arms"):
        SafetyLayer([gantry()], [BALL] * 2, [], DT)
    foreign = Body(np.array([[7.0, 0, 0, 0, 0, 0, 0, 0.01]]), ("hand",))
    with pytest.raises(BadModel, match=r"body: hand: moves with joint 7; .* has joints 0 to 2"):
        SafetyLayer([gantry()], [foreign], [], DT)
    for pair in ((0, 1), (-1, 0), (0, 0.5), (0, 1e9)):
        with pytest.raises(BadOption, match=r"pair 0 names capsule .*; there are capsules 0 to 0"):
            SafetyLayer([gantry()], [BALL], [], DT, pairs=[pair])
    with pytest.raises(BadOption, match="pair 0 names capsule 0 twice"):
        SafetyLayer([gantry()], [BALL], [], DT, pairs=[(0, 0)])
    for allowed in ([("hand",)], ["ab"], [("hand", 3)]):
        with pytest.raises(WrongType, match=r"allowed\[0\] is .*; expected a pair of names"):
            SafetyLayer([gantry()], [BALL], [], DT, allowed=allowed)
    assert TALLY == 12
