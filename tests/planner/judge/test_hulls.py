"""The judge knows hulls: the planner's clear motions pass, its own numbers agree, and nothing is lost on the way."""

from __future__ import annotations

import itertools
import json

import numpy as np
import pytest
from helpers.arms import random_arm
from helpers.solids import random_pose

from onedemo.planner import Body, MotionLog, Obstacle, Sphere, certify, read_log, write_log
from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.collision.robot_arrays import robot_arrays
from onedemo.planner.geometry.shapes import Mesh, pack
from onedemo.planner.log.motion_log import BadLog, content_of
from onedemo.planner.robot.body import Hull


def thin_arm(seed: int) -> tuple:
    """An arm whose capsules are wide and what they cover is thin, and obstacles among which capsules touch."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, 4, 0.0)
    rows = [[k, 0, 0, 0, 0.15, 0, 0, 0.08] for k in range(-1, 4)]
    bar = np.array([[x, y, z] for x in (0.0, 0.15) for y in (-0.01, 0.01) for z in (-0.01, 0.01)])
    hull = Hull(bar, 0.002)
    body = Body(
        np.array(rows), tuple(f"part{k}" for k in range(5)), hulls=(hull,) * 5, pairs=((0, 3),), margins={(0, 3): 0.004}
    )
    obstacles = [Obstacle(Sphere(0.05), random_pose(rng, rng.uniform(-0.6, 0.6, 3)), name=f"ball{k}") for k in range(4)]
    solid = Mesh.hull_of(rng.normal(size=(12, 3)) * 0.05)
    obstacles.append(Obstacle(solid, random_pose(rng, rng.uniform(-0.6, 0.6, 3)), name="stone"))
    return arm, body, obstacles, rng


def slack_along(arm, body: Body, obstacles, joints: np.ndarray) -> float:
    g = robot_arrays((arm,), (body,), pack(obstacles), margin=0.0)
    dense = [a + s * (b - a) for a, b in itertools.pairwise(joints) for s in np.linspace(0, 1, 20)]
    return min(slack_at(g, q, 0.0, 1.0) for q in dense)


@pytest.mark.parametrize("seed", range(12))
def test_the_judge_finds_the_clearance_of_the_hulls(seed):
    arm, body, obstacles, rng = thin_arm(seed)
    joints = np.linspace(rng.uniform(-2, 2, 4), rng.uniform(-2, 2, 4), 40)
    log = MotionLog(arm, body, tuple(obstacles), 0.1 * np.arange(40), joints, 0.0)
    bare = MotionLog(arm, Body(body.rows, body.names), tuple(obstacles), log.time, joints, 0.0)
    found, wide, mine = certify(log), certify(bare), slack_along(arm, body, obstacles, joints)
    # bounds are proven to within half a millimetre of what is found
    assert found.clearance >= wide.clearance - 6e-4
    # the planner asks hulls below 2 cm, the judge below 5 cm; both give lower bounds
    if mine > 0.0:
        assert found.sampled_clearance >= mine - 1e-4
    else:  # numbers of what touches have no meaning but their sign
        assert found.sampled_clearance <= 1e-4
    if 0.0 < mine < 0.015:
        assert found.sampled_clearance == pytest.approx(mine, abs=1e-3)
    assert found.clearance <= found.sampled_clearance + 1e-9


def test_hulls_decide_what_is_certified():
    more = 0
    for seed in range(30):
        arm, body, obstacles, rng = thin_arm(seed)
        joints = np.linspace(rng.uniform(-2, 2, 4), rng.uniform(-2, 2, 4), 40)
        logs = [
            MotionLog(arm, each, tuple(obstacles), 0.2 * np.arange(40), joints, 0.005)
            for each in (body, Body(body.rows, body.names))
        ]
        exact, coarse = (certify(log).ok for log in logs)
        assert exact or not coarse
        more += exact and not coarse
        if exact:
            assert slack_along(arm, body, obstacles, joints) >= 0.005 - 1e-4
    assert more >= 3


def test_a_log_keeps_hulls_and_pairs_to_the_bit(tmp_path):
    arm, body, obstacles, _ = thin_arm(0)
    log = MotionLog(arm, body, tuple(obstacles), np.zeros(1), np.zeros((1, 4)), 0.0)
    write_log(log, tmp_path / "log.json")
    again = read_log(tmp_path / "log.json").body
    assert again.pairs == body.pairs and again.margins == body.margins and len({id(hull) for hull in again.hulls}) == 1
    assert np.array_equal(again.hulls[0].corners, body.hulls[0].corners) and again.hulls[0].rounding == 0.002


@pytest.mark.parametrize(
    "change, says",
    [
        (lambda t: t.update(hull_of=[0, 0, 0, 0, 7]), "hull_of.*from -1 to 0"),
        (lambda t: t.update(hull_of=[0, 0]), "hull_of.*expected 5"),
        (lambda t: t.update(hull_of=[0.5] * 5), "hull_of.*not whole"),
        (lambda t: t["hulls"][0].update(rounding=-1.0), "part0"),
        (lambda t: t["hulls"][0].update(corners=[[0, 0]]), r"corners\[0\]"),
        (lambda t: t.update(pairs=[[3, 1]]), "pairs"),
        (lambda t: t.update(pairs=[[0, 99]]), "pairs"),
        (lambda t: t.update(margins=[[0, 1, 0.004]]), "margins"),
        (lambda t: t.update(margins=[[0, 3, -0.004]]), "margins"),
        (lambda t: t.update(margins=[[0, 3]]), "margins"),
    ],
)
def test_hulls_of_a_file_are_checked(tmp_path, change, says):
    arm, body, obstacles, _ = thin_arm(0)
    content = content_of(MotionLog(arm, body, tuple(obstacles), np.zeros(1), np.zeros((1, 4)), 0.0))
    change(content["body"])
    (tmp_path / "log.json").write_text(json.dumps({**content, "sha256": "0" * 64}))
    with pytest.raises(BadLog, match=says):
        read_log(tmp_path / "log.json")
