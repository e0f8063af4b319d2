"""The judge of constraints: agrees with the planner's measure, and notices what was planted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import READY, panda
from helpers.planner.carried_paths import shifted, turned

from onedemo.planner import Body, MotionLog, PosePath
from onedemo.planner.constraints.violation import violation_of
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.imitation.kept_components import found_constraint
from onedemo.planner.judge.kept import kept_finding

DEGREE = np.deg2rad(1.0)


@pytest.fixture(scope="module")
def poured() -> tuple[PosePath, np.ndarray]:
    """A path of the Panda's tool that is carried level, then turned; and its joints."""
    arm, first = panda(), panda().fk(READY)
    poses = [shifted(0.0, 0.004 * min(k, 25)) @ first @ turned((1, 0, 0), 0.02 * max(0, k - 25)) for k in range(60)]
    joints, q = [], READY
    for pose in poses:
        q = inverse_kinematics(arm, pose, q)
        assert q is not None
        joints.append(q)
    return PosePath(np.array([pose.dq for pose in poses])), np.array(joints)


def log_of(path: PosePath, joints: np.ndarray) -> MotionLog:
    return MotionLog(panda(), Body(np.empty((0, 8)), ()), (), 0.05 * np.arange(len(joints)), joints, 0.0, None, path)


def test_the_judge_agrees_with_the_planner(poured):
    path, joints = poured
    constraint = found_constraint(path)
    assert constraint.components == 2 and constraint.guided < len(path)
    found = kept_finding(log_of(path, joints), constraint)
    mine = violation_of(constraint, path, PosePath(np.array([panda().fk(q).dq for q in joints])))
    assert found.sampled <= found.certified <= 1.0
    assert found.sampled == pytest.approx(mine.share, abs=0.2)


@pytest.mark.parametrize("joint", [3, 5, 6])
def test_a_planted_tilt_is_noticed(poured, joint):
    path, joints = poured
    constraint = found_constraint(path)
    tilted = joints.copy()
    tilted[10, joint] += 30.0 * DEGREE
    found, clean = (kept_finding(log_of(path, each), constraint) for each in (tilted, joints))
    gone = panda().fk(tilted[10]).rotation[2] @ panda().fk(joints[10]).rotation[2]
    assert found.sampled == pytest.approx(max(clean.sampled, np.arccos(min(gone, 1.0)) / constraint.bound), abs=0.15)


def test_a_guided_stretch_that_is_left_out_is_noticed(poured):
    path, joints = poured
    assert kept_finding(log_of(path, joints[:40]), found_constraint(path)).sampled > 1.0


def test_nothing_kept_is_never_violated(poured):
    path, joints = poured
    free = replace(found_constraint(path), directions=np.empty((0, 3)), guided=len(path))
    assert kept_finding(log_of(path, joints), free).certified < 1e-9
