"""Tables that name the rows and columns of packed arrays, and rows written by them."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.planner import jit
from onedemo.planner.collision.robot_arrays import (
    CAPSULE,
    HEADER,
    LAST_LOOK,
    MAX_JOINTS,
    NEAR_PAIR,
    PLACED,
    ROW,
    SETTING,
)
from onedemo.planner.collision.robot_arrays import WIDTH as ROBOT_WIDTH
from onedemo.planner.columns import packed_row
from onedemo.planner.control.arm_arrays import ARM, CONTROL, PURSUIT, PURSUIT_STATE
from onedemo.planner.control.arm_arrays import WIDTH as ARM_WIDTH
from onedemo.planner.control.controller import ControllerSettings
from onedemo.planner.control.pursuit import PursuitSettings
from onedemo.planner.escape.repet import VERDICTS, RepetSettings
from onedemo.planner.escape.tree_arrays import DETOUR_LOG, HEAP, NODE, OPTION, VERDICT
from onedemo.planner.geometry.shapes import OBSTACLE
from onedemo.planner.robot.body import BODY, TOOL_CAPSULE
from onedemo.planner.robot.kinematics import CHAIN, FRAME
from onedemo.planner.safety.qp import QP
from onedemo.planner.safety.safety_layer import SafetySettings

IN_ROBOT = (HEADER, SETTING, LAST_LOOK, CAPSULE, PLACED, NEAR_PAIR, OBSTACLE, QP, CHAIN, FRAME)
IN_ARM = (CONTROL, PURSUIT, CHAIN, FRAME)
OTHERS = (ROW, ARM, PURSUIT_STATE, NODE, VERDICT, OPTION, HEAP, DETOUR_LOG, BODY, TOOL_CAPSULE)


@pytest.mark.parametrize("table", (*IN_ROBOT, *IN_ARM, *OTHERS), ids=lambda table: type(table).__name__)
def test_no_two_names_share_a_column(table):
    """But for the number of columns that `pack` fills, at which the next ones begin."""
    places = [value for name, value in table._asdict().items() if name != "packed"]
    assert places == sorted(set(places)) and min(places) >= 0


def test_every_row_is_wide_enough():
    assert max(max(table) for table in IN_ROBOT) < ROBOT_WIDTH and max(max(table) for table in IN_ARM) <= ARM_WIDTH
    assert LAST_LOOK.slack >= MAX_JOINTS and QP.image >= MAX_JOINTS and len(VERDICTS) == len(VERDICT)


def test_settings_lie_at_the_columns_of_their_names():
    safety = SafetySettings(self_distance=0.02, alpha=5.0, decay=0.25).packed(0.1)
    assert (safety[SETTING.self_margin], safety[SETTING.alpha], safety[SETTING.decay]) == (0.02, 5.0, 0.25)
    assert safety[SETTING.limit_gain] == 10.0
    control = ControllerSettings(law="paper", null_gain=0.25).packed()
    assert (control[CONTROL.law], control[CONTROL.null_gain]) == (1.0, 0.25)
    pursuit = PursuitSettings(advance="paper", patience=2.0).packed()
    assert (pursuit[PURSUIT.every_tick], pursuit[PURSUIT.decoupled], pursuit[PURSUIT.patience]) == (1.0, 0.0, 2.0)
    options = RepetSettings(cell=0.5, bias=(1.0, 2.0, 3.0), trigger="shell").packed()
    assert (options[OPTION.cell], options[OPTION.on_shell], options[OPTION.turn]) == (0.5, 1.0, 0.0)
    assert options[OPTION.bias : OPTION.bias + 3].tolist() == [1.0, 2.0, 3.0] and len(options) == OPTION.width


@pytest.mark.parametrize("values", [{}, {"a": (0, 0, 0), "b": (0, 0, 0)}, {"a": 0, "b": 0, "radius": 0, "size": 0}])
def test_a_row_has_a_value_for_every_name_and_no_other(values):
    with pytest.raises(TypeError, match="ToolCapsuleColumns"):
        packed_row(TOOL_CAPSULE, **values)


def test_a_name_is_a_constant_in_a_kernel():
    row = packed_row(TOOL_CAPSULE, a=(1.0, 2.0, 3.0), b=np.array([4.0, 5.0, 6.0]), radius=7.0)
    assert row.tolist() == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0]
    assert jit.numba.njit(lambda row: row[TOOL_CAPSULE.radius] + row[TOOL_CAPSULE.b + 1])(row) == 12.0
