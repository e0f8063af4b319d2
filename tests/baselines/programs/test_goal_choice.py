"""The choice among goals that look alike: made where the task can go on, among what stands around."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from helpers.random_scenes import at, demonstrated, panda

from onedemo.baselines.programs import goal_choice
from onedemo.baselines.programs.goal_choice import MotionChoice
from onedemo.planner.errors import PlanFailed
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Obstacle, Sphere
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.judge.certify import certify
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.settings import PlanSettings
from onedemo.planner.resumable import finished

SETTINGS = PlanSettings()
PLACE = (0.0, 0.35, 1.0)


def choose(*given):
    return finished(goal_choice.choose(*given))


def departure_path(*given):
    return finished(goal_choice.departure_path(*given))


def goals(count=4, place=PLACE):
    """The same place, the tool turned about the vertical."""
    end = at([0, 0, 0], demonstrated()[-1].quaternion)
    return tuple(Pose.from_yaw(place, k * 2.0 * np.pi / count) @ end for k in range(count))


def a_leg(obstacles=(), **changes):
    return MotionChoice("cup", demonstrated(), goals(), panda()[1], tuple(obstacles), **changes)


def assert_clear(choice):
    certificate = certify(choice.plan.log())
    assert certificate.ok, certificate.reasons


def test_in_free_space_the_goal_with_most_joint_margin_is_taken():
    arm, _, home = panda()
    choice = choose(arm, SETTINGS, home, a_leg())
    plans = [Planner(arm, panda()[1]).plan(demonstrated(), home, goal) for goal in goals()]
    margins = [plan.margin if plan.success and plan.imitated_share > 0.9 else -1.0 for plan in plans]
    assert choice.index == int(np.argmax(margins)) and choice.plan.success and choice.then is None
    np.testing.assert_array_equal(choice.plan.request.goal.dq, goals()[choice.index].dq)
    assert choice.next_motion is None
    assert [exact for _, exact in choice.parts] == [True]


@pytest.mark.parametrize("quarter", [0, 1])
def test_among_obstacles_the_goal_that_fits_is_taken(quarter):
    """Between two boards the hand, wide along x of the tcp, fits one way round only."""
    arm, _, home = panda()
    wide = Pose(goals()[quarter].dq).rotation[:, 0]
    turn = Pose.from_yaw(PLACE, float(np.arctan2(wide[1], wide[0])))
    boards = [
        Obstacle(Box((0.25, 0.02, 0.06)), turn @ at([0.0, side, 0.03]), name=f"board{side:+.1f}")
        for side in (-0.1, 0.1)
    ]
    choice = choose(arm, SETTINGS, home, a_leg(boards))
    assert choice.index % 2 == quarter
    assert_clear(choice)


def test_what_is_held_counts():
    arm, empty, home = panda()
    tall = empty.holding("held", Box((0.04, 0.04, 0.3)), at([0.0, 0.0, 0.15]), arm)
    shelf = Obstacle(Box((0.2, 0.2, 0.02)), at(np.array(PLACE) - [0.0, 0.0, 0.2]), name="shelf")
    assert choose(arm, SETTINGS, home, a_leg([shelf])).plan.success
    with pytest.raises(PlanFailed, match=r"blocked: no goal of cup .*: goal in collision: held touches shelf"):
        choose(arm, SETTINGS, home, a_leg([shelf])._replace(body=tall))
    touch = (("held", "shelf"), ("fingers", "shelf"), ("hand", "shelf"))
    assert choose(arm, SETTINGS, home, a_leg([shelf], allowed=touch)._replace(body=tall)).plan.success


def test_a_goal_from_which_the_task_goes_on_beats_one_that_is_nearer():
    """The next motion can be done after one of the goals only: that one is taken, whatever its margin."""
    arm, body, home = panda()
    first = choose(arm, SETTINGS, home, a_leg()).index
    far = (at([3.0, 0.0, 1.0], goals()[0].quaternion),)
    for wanted in {0, 1, 2, 3} - {first}:
        if not choose(arm, SETTINGS, home, a_leg()._replace(goals=(goals()[wanted],))).plan.success:
            continue
        near = tuple(at([0.0, 0.0, 0.1]) @ goal for goal in goals())

        def next_motion(index, wanted=wanted, near=near):
            return MotionChoice(
                "cup", demonstrated(), near if index == wanted else far, body, (), leaving=demonstrated()
            )

        choice = choose(arm, replace(SETTINGS, search=None), home, a_leg(), next_motion)
        assert choice.index == wanted and choice.then is not None and choice.then.plan.success
        np.testing.assert_array_equal(choice.then.plan.joints[0], choice.plan.joints[-1])
        assert (
            choice.next_motion is not None
            and choice.next_motion.path[-1].distance_to(choice.then.plan.request.goal)[0] < 1e-9
        )
        return
    pytest.fail("no other goal can be reached")


def test_where_no_goal_can_be_reached_the_reason_is_one_of_the_task():
    arm, _, home = panda()
    away = a_leg()._replace(goals=goals(place=(2.0, 0.0, 1.0)))
    with pytest.raises(PlanFailed, match="no goal of cup can be reached") as caught:
        choose(arm, SETTINGS, home, away)
    assert caught.value.reason == "ik_or_limit"
    ball = Obstacle(Sphere(0.1), at(PLACE), name="ball")
    with pytest.raises(PlanFailed, match="ball") as caught:
        choose(arm, SETTINGS, home, a_leg([ball]))
    assert caught.value.reason == "blocked"


def test_what_moves_is_left_to_the_moment():
    arm, _, home = panda()
    ball = Obstacle(Sphere(0.1), at(PLACE), np.array([0.2, 0.0, 0.0]), "ball")
    assert choose(arm, SETTINGS, home, a_leg([ball])).plan.success


def test_leaving_is_as_shown_or_straight_up_where_that_cannot_be():
    arm, _, home = panda()
    start = arm.fk(home)
    aside = screw_path(start, at([0.2, 0.0, 0.0]) @ start, 0.005)
    motion = a_leg(leaving=aside)
    shown = departure_path(arm, SETTINGS, home, motion)
    assert shown is not None and departure_path(arm, SETTINGS, home, a_leg()) is None
    np.testing.assert_allclose(shown[-1].position - start.position, [0.09, 0.0, 0.0], atol=5e-3)
    wall = Obstacle(Box((0.02, 0.3, 0.1)), at(start.position + np.array([0.1, 0.0, -0.02])), name="wall")
    up = departure_path(arm, SETTINGS, home, motion._replace(obstacles=(wall,)))
    assert up is not None
    np.testing.assert_allclose(up[-1].position - start.position, [0.0, 0.0, 0.09], atol=1e-9)
    choice = choose(arm, SETTINGS, home, motion)
    assert [exact for _, exact in choice.parts] == [False, True]
    np.testing.assert_array_equal(choice.parts[0][0].dqs, shown.dqs)
    np.testing.assert_array_equal(choice.tail.dqs, choice.parts[1][0].dqs)
    assert (
        choice.path[0].distance_to(start)[0] < 1e-9 and choice.path[-1].distance_to(choice.plan.request.goal)[0] < 1e-9
    )
