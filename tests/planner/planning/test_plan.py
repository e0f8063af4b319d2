"""Requests and plans: what is accepted as a demonstration, and what a plan carries for its judge."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import demonstrated, panda, problem

import onedemo
from onedemo.planner import Plan, PlanRequest, certify, read_log, smoothed, timed, write_log
from onedemo.planner.errors import BadOption, NotFinite, UnknownName
from onedemo.planner.planning.plan import MotionPlanner, segment_of
from onedemo.planner.planning.planner import Planner

SHOWN = onedemo.load_demonstration("stack")
SINGLE = replace(SHOWN, segments=SHOWN.segments[1:])


def same(one: Plan, other: Plan) -> bool:
    return one.joints.tobytes() == other.joints.tobytes() and one.path_poses.tobytes() == other.path_poses.tobytes()


def test_a_demonstration_is_as_good_as_the_path_of_its_segment():
    arm, body, home = panda()
    planner, goal = Planner(arm, body), demonstrated()[-1]
    by_path = planner.plan(SHOWN.segment_path("transfer"), home, goal)
    assert by_path.success
    assert same(by_path, planner.plan(SHOWN, home, goal, segment="transfer"))
    assert same(by_path, planner.plan(SINGLE, home, goal))
    whole = planner.plan(replace(SHOWN, segments=()), home, goal)
    assert whole.request.demonstrated is SHOWN.path
    assert same(by_path, planner.answer(PlanRequest(SHOWN.segment_path("transfer"), home, goal)))


def test_which_segment_is_meant_must_be_clear():
    np.testing.assert_array_equal(segment_of(SINGLE).dqs, SHOWN.segment_path("transfer").dqs)
    with pytest.raises(BadOption, match="option 'segment': 'stack' has several: name one of approach, transfer"):
        segment_of(SHOWN)
    with pytest.raises(UnknownName, match="'carry'; known: approach, transfer"):
        segment_of(SHOWN, "carry")
    with pytest.raises(BadOption, match="a path has no segments"):
        segment_of(SHOWN.path, "transfer")
    arm, body, home = panda()
    with pytest.raises(NotFinite):
        Planner(arm, body).plan(SINGLE, np.full_like(home, np.nan), demonstrated()[-1])


def test_a_plan_carries_all_that_its_judge_needs(tmp_path):
    scene = problem("clutter", 0)
    arm, body, _ = panda()
    plan = Planner(arm, body).plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    assert plan.success and plan.arm is arm and plan.body is body
    assert plan.request.obstacles == tuple(scene.obstacles) and plan.request.goal is scene.goal
    log = plan.log()
    assert log.safety == plan.settings.safety.distance and log.claims == {"joint_margin": plan.margin}
    assert certify(log).ok
    for refined in (smoothed(plan), timed(plan), timed(smoothed(plan))):
        assert certify(refined.log()).ok, refined.refined
    write_log(log, tmp_path / "plan.json")
    assert certify(read_log(tmp_path / "plan.json")).log_sha256 == certify(log).log_sha256
    bent = plan._replace(joints=plan.joints + np.linspace(0.0, 0.3, len(plan.joints))[:, None])
    assert not certify(bent.log()).ok, "the judge believes anything"


def test_a_failed_plan_claims_nothing():
    scene = problem("cage", 0)
    arm, body, _ = panda()
    plan = Planner(arm, body).plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    assert not plan.success
    log = plan.log()
    assert log.claims == {} and log.demonstrated is None and len(log.joints) == 1
    assert not certify(log).ok


def test_every_planner_has_the_one_signature():
    def below(kind):
        return [each for sub in kind.__subclasses__() for each in (sub, *below(sub))]

    import onedemo.baselines.motion.generated_plan
    import onedemo.baselines.motion.rrt_planner
    import onedemo.baselines.motion.tool_frame  # noqa: F401

    kinds = below(MotionPlanner)
    assert len(kinds) == 4
    assert all("plan" not in vars(kind) and "answering" in vars(kind) for kind in kinds)
