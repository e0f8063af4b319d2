"""The judge: its distances, kinematics and bounds against other oracles, and lies that it must not believe."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import READY
from helpers.planner.motion_logs import NAMES, SECONDS, STEPS, at, good
from scipy.spatial.transform import Rotation

from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Cylinder, Obstacle, Sphere
from onedemo.planner.judge.certify import Certificate, certify
from onedemo.planner.judge.geometry import Kinematics
from onedemo.planner.judge.sweep import SweepSettings
from onedemo.planner.log.motion_log import MotionLog, digest_of, read_log, write_log
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body


def with_arm(log: MotionLog, **changes) -> MotionLog:
    keys = ("name", "joint_names", "chain", "lower", "upper", "velocity_limits")
    return replace(log, arm=Arm(**{**{key: getattr(log.arm, key) for key in keys}, **changes}))


def with_chain(log: MotionLog, row: int, column: int, by: float) -> MotionLog:
    chain = log.arm.chain.copy()
    chain[row, column] += by
    return with_arm(log, chain=chain)


def with_obstacle(log: MotionLog, name: str, **changes) -> MotionLog:
    keys = ("shape", "pose", "velocity", "name", "margin")
    made = [
        Obstacle(**{**{key: getattr(o, key) for key in keys}, **changes}) if o.name == name else o
        for o in log.obstacles
    ]
    return replace(log, obstacles=tuple(made))


def with_rows(log: MotionLog, name: str, column: int, value: float) -> MotionLog:
    rows = log.body.rows.copy()
    rows[[k for k, other in enumerate(NAMES) if other == name], column] += value
    return replace(log, body=Body(rows, log.body.names, log.body.held))


def with_joints(log: MotionLog, index: int, joint: int, by: float) -> MotionLog:
    joints = log.joints.copy()
    joints[index, joint] += by
    return replace(log, joints=joints)


def without(log: MotionLog, *names: str) -> MotionLog:
    return replace(
        log,
        obstacles=tuple(o for o in log.obstacles if o.name not in names),
        allowed=tuple(pair for pair in log.allowed if pair[1] not in names),
    )


def with_claim(log: MotionLog, key: str, by: float) -> MotionLog:
    return replace(log, claims={**log.claims, key: log.claims[key] + by})


def unclaimed(log: MotionLog) -> MotionLog:
    return replace(log, claims={})


def blade(log: MotionLog, index: int = 40, fraction: float = 0.5) -> Obstacle:
    """A sheet thinner than a step, where the cup passes between two samples."""
    q = log.joints[index] + fraction * (log.joints[index + 1] - log.joints[index])
    moment = Kinematics(log.arm, log.body).moment(
        np.zeros(2), np.array([q, q + 1e-4 * (log.joints[41] - log.joints[40])])
    )
    center, ahead = moment.ends[:, -1].mean(axis=1)
    normal = (ahead - center) / np.linalg.norm(ahead - center)
    turn, _ = Rotation.align_vectors([normal], [[0, 0, 1]])
    x, y, z, w = turn.as_quat()
    return Obstacle(Box((0.3, 0.3, 1e-6)), Pose.from_position_quaternion(center, [w, x, y, z]), name="blade")


def fast(log: MotionLog) -> MotionLog:
    """Two samples, start and end, with a thin sheet between them."""
    picked = [0, STEPS - 1]
    log = replace(unclaimed(log), joints=log.joints[picked], time=log.time[picked], allowed=(), demonstrated=None)
    return replace(log, obstacles=(blade(good()),))


# ---- what is true passes ----


def test_a_good_log_is_certified_and_the_numbers_are_right():
    log = good()
    found = certify(log, expected=log)
    assert found.reasons == ()
    assert found.ok
    assert 0.01 <= found.clearance <= found.sampled_clearance < 0.05
    assert found.position_error == pytest.approx(0.001, abs=1e-12)
    assert found.angle_error == pytest.approx(0.002, abs=1e-9)
    assert abs(found.deviation - log.claims["deviation"]) <= found.deviation_gap < 5e-4
    assert found.joint_margin == pytest.approx(min(log.arm.margin(q) for q in log.joints), abs=1e-15)
    dt = SECONDS / (STEPS - 1)
    assert found.speed_ratio == pytest.approx(
        np.max(np.abs(np.diff(log.joints, axis=0)) / dt / log.arm.velocity_limits)
    )
    assert set(found.clearances) == set(NAMES)
    assert min(found.clearances.values()) == found.clearance
    assert found.log_sha256 == digest_of(log)


def test_a_log_goes_through_a_file_without_losing_a_bit(tmp_path):
    log = good()
    write_log(log, tmp_path / "a.json")
    again = read_log(tmp_path / "a.json")
    write_log(again, tmp_path / "b.json")
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()
    assert digest_of(again) == digest_of(log)
    assert certify(again, expected=log) == certify(log)


def test_limits_that_are_infinite_and_absent_parts_go_through_a_file(tmp_path):
    log = with_arm(good(), lower=np.full(7, -np.inf), upper=np.full(7, np.inf))
    log = replace(log, goal=None, demonstrated=None, claims={}, allowed=(), obstacles=())
    write_log(log, tmp_path / "a.json")
    found = certify(read_log(tmp_path / "a.json"), expected=log)
    assert found.ok
    assert found.clearance == np.inf
    table = json.loads(found.to_json())
    assert table["clearance"] is None and table["joint_margin"] is None and table["ok"] is True


def test_a_certificate_is_written_as_it_is(tmp_path):
    found = certify(with_claim(good(), "clearance", 0.01))
    found.write(tmp_path / "c.json")
    table = json.loads((tmp_path / "c.json").read_text())
    assert set(table) == {"format_version", *Certificate.__slots__}
    assert table["reasons"] == list(found.reasons) and table["ok"] is False


def test_one_sample_is_a_motion_too():
    log = replace(good(), time=[0.0], joints=good().joints[-1:], demonstrated=None, claims={})
    assert certify(log).ok


# ---- lies about the motion, found by looking at it ----

LIES = {
    "a joint jumps": (lambda g: with_joints(g, 50, 3, 0.3), "speed: panda_joint4"),
    "a joint strays a little in the kept end": (lambda g: with_joints(g, 65, 1, 0.012), "claims.deviation"),
    "the last sample is shifted": (lambda g: with_joints(g, -1, 2, 0.02), "goal: position_error"),
    "a joint leaves its limits": (lambda g: with_joints(g, 0, 3, -1.2), "limits: panda_joint4"),
    "two joints are swapped": (lambda g: replace(g, joints=g.joints[:, [1, 0, 2, 3, 4, 5, 6]]), "goal: "),
    "two samples are swapped": (
        lambda g: replace(g, joints=g.joints[[*range(40), 60, *range(41, 60), 40, *range(61, STEPS)]]),
        "speed: ",
    ),
    "the motion runs backwards": (lambda g: replace(g, joints=g.joints[::-1]), "goal: position_error"),
    "time runs backwards": (lambda g: replace(g, time=g.time[::-1]), "time: does not rise"),
    "time stands still once": (lambda g: replace(g, time=np.r_[g.time[:2], g.time[1], g.time[3:]]), "time: "),
    "time is ten times faster": (lambda g: replace(g, time=g.time / 10), "speed: "),
    "the end is cut off": (lambda g: replace(g, time=g.time[:65], joints=g.joints[:65]), "goal: "),
    "the middle is cut out": (
        lambda g: replace(
            g, time=np.delete(g.time, np.s_[30:50])[:-20], joints=np.delete(g.joints, np.s_[30:50], 0)[20:]
        ),
        "speed: ",
    ),
    "an obstacle stands in the way": (lambda g: with_obstacle(g, "ball", pose=at(0.5, 0.3, 0.4)), "clearance: "),
    "an obstacle has grown": (lambda g: with_obstacle(g, "post", shape=Cylinder(0.3, 0.4)), "clearance: "),
    "an obstacle has grown a little": (lambda g: with_obstacle(g, "ball", shape=Sphere(0.1)), "claims.clearance"),
    "an obstacle flies another way": (
        lambda g: with_obstacle(g, "flying", velocity=np.array([-0.1, 0.25, 0.0])),
        "clearance: ",
    ),
    "an obstacle wants more room": (lambda g: with_obstacle(g, "table", margin=0.5), "clearance: l2 is"),
    "a link has grown": (lambda g: with_rows(g, "l4", 7, 0.3), "clearance: l4"),
    "a contact is not allowed": (
        lambda g: replace(g, allowed=tuple(pair for pair in g.allowed if pair[0] != "cup")),
        "clearance: cup is at least",
    ),
    "more safety is claimed": (lambda g: replace(g, safety=0.05), "clearance: "),
    "more clearance is claimed": (lambda g: with_claim(g, "clearance", 0.001), "claims.clearance"),
    "a smaller position error is claimed": (lambda g: with_claim(g, "position_error", -2e-6), "claims.position_error"),
    "a smaller angle error is claimed": (lambda g: with_claim(g, "angle_error", -2e-6), "claims.angle_error"),
    "more joint margin is claimed": (lambda g: with_claim(g, "joint_margin", 2e-6), "claims.joint_margin"),
    "less deviation is claimed": (lambda g: with_claim(g, "deviation", -6e-4), "claims.deviation"),
    "an error is claimed of no goal": (lambda g: replace(g, goal=None), "claims.position_error"),
    "the goal is elsewhere": (lambda g: replace(g, goal=g.goal @ at(0, 0.02, 0)), "goal: position_error"),
    "the goal is turned": (lambda g: replace(g, goal=g.goal @ Pose.from_yaw([0, 0, 0], 0.1)), "goal: angle_error"),
    "the demonstrated path ran backwards": (
        lambda g: replace(g, demonstrated=g.demonstrated.reversed()),
        "claims.deviation",
    ),
    "the demonstrated path is elsewhere": (
        lambda g: replace(g, demonstrated=g.demonstrated.moved(at(0, 0, 0.01))),
        "claims.deviation",
    ),
    "the demonstrated path is longer": (
        lambda g: replace(g, demonstrated=PosePath(np.vstack([g.arm.fk(READY + 0.3).dq, g.demonstrated.dqs]))),
        "claims.deviation",
    ),
    "the arm is longer": (lambda g: with_chain(g, 4, 6, 0.01), "goal: position_error"),
    "a joint slides instead of turning": (lambda g: with_chain(g, 3, 7, 1.0), "goal: "),
    "the joints are slower": (lambda g: with_arm(g, velocity_limits=g.arm.velocity_limits / 10), "speed: "),
    "the limits are narrower": (lambda g: with_arm(g, upper=np.r_[g.arm.upper[:5], 2.2, 2.9]), "limits: panda_joint6"),
    "a sheet thinner than a step is crossed": (
        lambda g: replace(unclaimed(g), obstacles=(*g.obstacles, blade(g))),
        "clearance: cup",
    ),
    "a sheet is crossed in one long step": (fast, "clearance: cup is at least 30.0 mm inside blade"),
}


@pytest.mark.parametrize("lie", LIES)
def test_a_lie_about_the_motion_is_found_and_named(lie):
    change, reason = LIES[lie]
    found = certify(change(good()))
    assert not found.ok
    assert any(text.startswith(reason) for text in found.reasons), found.reasons


# ---- lies about the problem: true motions of another world ----

OTHER_PROBLEMS = {
    "an obstacle is left out": (lambda g: without(g, "post"), "obstacles"),
    "an obstacle has shrunk": (lambda g: with_obstacle(g, "ball", shape=Sphere(0.079)), "obstacles"),
    "an obstacle has moved away": (lambda g: with_obstacle(g, "rock", pose=at(0.8, 0, 0.05)), "obstacles"),
    "an obstacle stands still": (lambda g: with_obstacle(g, "flying", velocity=np.zeros(3)), "obstacles"),
    "an obstacle wants less room": (lambda g: with_obstacle(g, "ball", margin=0.0), "obstacles"),
    "there is no obstacle": (lambda g: without(g, "table", "ball", "post", "rock", "flying", "coaster"), "obstacles"),
    "a link has shrunk": (lambda g: with_rows(g, "hand", 7, -0.01), "body"),
    "a capsule moves with another joint": (lambda g: with_rows(g, "cup", 0, -4), "body"),
    "the held object is dropped": (
        lambda g: replace(g, body=g.body.released(), allowed=[p for p in g.allowed if p[0] != "cup"]),
        "body",
    ),
    "another contact is allowed": (lambda g: replace(g, allowed=(*g.allowed, ("l6", "ball"))), "allowed"),
    "the limits are wider": (lambda g: with_arm(g, upper=g.arm.upper + 0.1), "arm"),
    "the joints are faster": (lambda g: with_arm(g, velocity_limits=2 * g.arm.velocity_limits), "arm"),
    "the arm is longer": (lambda g: with_chain(g, 4, 6, 1e-9), "arm"),
    "less safety is claimed": (lambda g: replace(g, safety=0.001), "safety"),
    "the goal is nearer": (lambda g: replace(g, goal=g.arm.fk(g.joints[-1])), "goal"),
    "there is no goal": (
        lambda g: replace(g, goal=None, claims={k: v for k, v in g.claims.items() if "error" not in k}),
        "goal",
    ),
    "the kept path is shorter": (lambda g: replace(g, demonstrated=g.demonstrated[3:]), "demonstrated"),
}


@pytest.mark.parametrize("lie", OTHER_PROBLEMS)
def test_a_true_motion_of_another_problem_is_refused(lie):
    change, key = OTHER_PROBLEMS[lie]
    found = certify(change(good()), expected=good())
    assert not found.ok
    problems = [reason for reason in found.reasons if reason.startswith("problem: ")]
    assert f"problem: {key} is not that of the expected problem" in problems
    assert found.reasons == tuple(problems), "nothing else is wrong: without `expected` it would pass"


def test_the_expected_problem_says_nothing_of_the_motion():
    g = good()
    problem = replace(g, time=[0.0], joints=READY[None], claims={}, demonstrated=None)
    assert certify(g, expected=problem).ok


def test_a_claimed_clearance_is_believed_up_to_the_truth_and_not_a_few_micrometers_beyond():
    g = good()
    near = certify(g).sampled_clearance
    truth = certify(replace(g, claims={"clearance": near})).sampled_clearance
    assert certify(replace(g, claims={"clearance": truth})).ok
    found = certify(replace(g, claims={"clearance": truth + 3e-6}))
    assert [reason.split(":")[0] for reason in found.reasons] == ["claims.clearance"]
    assert "is the truth" in found.reasons[0]


def test_what_is_not_proven_is_not_certified():
    g = unclaimed(good())
    tight = replace(g, safety=certify(g).sampled_clearance - 2e-6)
    assert certify(tight).ok
    found = certify(tight, settings=SweepSettings(max_intervals=1))
    assert not found.ok
    assert found.reasons[0].startswith("clearance: undecided after ")
    assert any("not proven beyond" in reason for reason in found.reasons)
