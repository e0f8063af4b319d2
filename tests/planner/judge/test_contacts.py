"""Allowed contacts belong to the ends of a motion: the judge refuses what leads through an obstacle on the way."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.arms import random_arm
from helpers.random_scenes import SETTINGS, blocked, demonstrated, everywhere, panda, planner_of
from helpers.strategies import for_all
from hypothesis import strategies as st
from soak import random_obstacles

from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.collision.robot_arrays import robot_arrays
from onedemo.planner.geometry.shapes import pack
from onedemo.planner.judge.certify import CONTACT_ROOM, certify
from onedemo.planner.log.motion_log import MotionLog
from onedemo.planner.robot.body import Body

ARM, BODY, _ = panda()


@for_all(st.integers(0, 10**6), max_examples=60)
def test_the_excess_of_a_contact_is_that_of_many_samples(seed):
    """Samples by the planner's own queries: the judge bounds what they find, and refuses hardly more."""
    rng = np.random.default_rng(seed)
    arm = random_arm(seed, 4)
    frames = np.arange(4.0)
    rows = np.column_stack([frames, rng.uniform(-0.1, 0.1, (4, 6)), rng.uniform(0.03, 0.08, 4)])
    body = Body(rows, tuple(f"part{k}" for k in range(4)))
    obstacles = [replace(o, name=f"thing{k}", velocity=np.zeros(3)) for k, o in enumerate(random_obstacles(rng))]
    allowed = [(name, o.name) for name in body.names for o in obstacles if rng.uniform() < 0.4]
    joints = rng.uniform(-1.0, 1.0, 4) + np.linspace(0.0, 1.0, 5)[:, None] * rng.uniform(-0.5, 0.5, 4)
    log = MotionLog(arm, body, tuple(obstacles), np.arange(5.0), joints, 0.01, allowed=tuple(allowed))
    dense = np.array([joints[0] + s * (joints[-1] - joints[0]) for s in np.linspace(0.0, 1.0, 400)])
    excess = 0.0
    for k, obstacle in enumerate(obstacles):
        margin = 0.01 if obstacle.margin is None else obstacle.margin
        mine = [name in [one for one, other in allowed if other == obstacle.name] for name in body.names]
        if any(mine):
            # the judge counts at most a capsule's own radius as its depth
            gaps = np.full(len(dense), np.inf)
            for row, name in zip(rows[mine], np.array(body.names)[mine], strict=True):
                g = robot_arrays((arm,), (Body(row[None], (str(name),)),), pack([obstacles[k]]), margin=0.01)
                gaps = np.minimum(gaps, [max(slack_at(g, q, 0.0, 1.0) + margin, -row[-1]) for q in dense])
            excess = max(excess, min(margin, gaps[0], gaps[-1]) - gaps.min())
    found = certify(log)
    assert excess - 1e-3 <= found.contact_excess
    # it is examined until it is known whether the room that every contact has is exceeded
    assert excess > CONTACT_ROOM - 2e-3 or found.contact_excess <= CONTACT_ROOM + 1e-6
    assert any(reason.startswith("contacts: ") for reason in found.reasons) == (
        found.contact_excess > CONTACT_ROOM + 1e-6
    )


def test_a_motion_through_what_it_may_touch_is_refused():
    start, goal, ball = blocked()
    through = np.linspace(start, goal, 200)
    log = MotionLog(ARM, BODY, (ball,), 0.02 * np.arange(200), through, 0.01, allowed=everywhere(ball))
    found = certify(log)
    assert not found.ok and found.contact_excess > 0.02
    (reason,) = found.reasons
    assert (
        reason.startswith("contacts: ") and "deeper in ball at" in reason and any(part in reason for part in BODY.names)
    )
    # up to the middle the contact is one with the end
    half = certify(replace(log, time=log.time[:100], joints=through[:100]))
    assert half.ok and half.contact_excess <= CONTACT_ROOM, half.reasons
    assert certify(replace(log, obstacles=(), allowed=())).contact_excess == 0.0


@pytest.mark.parametrize("seed", range(3))
def test_no_plan_follows_a_demonstration_through_what_it_may_touch(seed):
    start, goal, ball = blocked()
    plan = planner_of().plan(demonstrated(), start, ARM.fk(goal), [ball], allowed=everywhere(ball), seed=seed)
    assert plan.success, plan.why
    found = certify(plan.log())
    assert found.ok and found.contact_excess <= CONTACT_ROOM, found.reasons
    assert SETTINGS.search is not None
    alone = planner_of(replace(SETTINGS, search=None, trees=False))
    failed = alone.plan(demonstrated(), start, ARM.fk(goal), [ball], allowed=everywhere(ball), seed=seed)
    assert failed.why == "an allowed contact is deeper on the way"
