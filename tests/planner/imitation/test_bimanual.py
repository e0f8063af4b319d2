"""Two arms: the relative path holds however it is shared; Jacobians are derivatives."""

from __future__ import annotations

import warnings

import numpy as np
import pytest
from helpers.arms import joints, random_arm
from helpers.strategies import assert_same_pose, for_all, random_dq, random_path
from hypothesis import strategies as st

from onedemo.planner.errors import BadOption, BadShape
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.imitation.bimanual import (
    HalfTurnPassed,
    absolute_path,
    relative_jacobian,
    relative_path,
    relative_twist_jacobian,
    shared_translation,
    split,
    task_relative_path,
    turns,
)
from onedemo.planner.imitation.tsia import imitated_path

seeds = st.integers(0, 10**6)
shares = st.one_of(st.sampled_from([0.0, 0.5, 1.0]), st.floats(0, 1))
LEVER = 0.2


def steps(path: PosePath) -> np.ndarray:
    return np.diff(path.lengths())


def a_gentle_path(rng: np.random.Generator) -> PosePath:
    """A relative path that stays clear of the half turn."""
    start = dq.dq_from_twist(rng.uniform(-0.5, 0.5, 6))
    twists = rng.normal(size=(12, 6)) * 0.05
    path = [start]
    for twist in twists:
        path.append(dq.mul(path[-1], dq.dq_from_twist(twist)))
    return PosePath(np.array(path))


def turning_path(last: float, count: int = 200, lean: float = 0.3) -> PosePath:
    """A relative path that turns from 0.2 to `last` rad about an axis that swings, and travels."""
    angle, way = np.linspace(0.2, last, count), np.linspace(0, 1, count)
    axis = np.stack([np.sin(lean * way), np.zeros(count), np.cos(lean * way)], axis=1)
    quaternion = np.concatenate([np.cos(angle / 2)[:, None], np.sin(angle / 2)[:, None] * axis], axis=1)
    position = np.stack([0.3 - 0.1 * way, 0.2 * way, 0.1 + 0 * way], axis=1)
    return PosePath(dq.from_position_quaternion(position, quaternion))


@for_all(seeds, shares, st.booleans())
def test_the_relative_path_holds_for_every_share_and_place(seed, beta, moving):
    rng = np.random.default_rng(seed)
    rho = a_gentle_path(rng)
    absolute = random_path(rng, len(rho)) if moving else Pose(random_dq(rng))
    left, right = split(rho, absolute, beta)
    assert_same_pose(relative_path(left, right).dqs, rho.dqs, 1e-12)
    expected = absolute.dqs if moving else np.broadcast_to(absolute.dq, rho.dqs.shape)
    assert_same_pose(absolute_path(left, right, beta).dqs, expected, 1e-12)


@for_all(seeds, shares)
def test_both_hands_are_powers_of_the_relative_pose_away_from_the_absolute_one(seed, beta):
    rng = np.random.default_rng(seed)
    rho, absolute = a_gentle_path(rng), Pose(random_dq(rng))
    left, right = split(rho, absolute, beta)
    assert_same_pose(left.dqs, dq.mul(absolute.dq, dq.power(rho.dqs, -beta)), 1e-12)
    assert_same_pose(right.dqs, dq.mul(absolute.dq, dq.power(rho.dqs, 1.0 - beta)), 1e-12)


@for_all(seeds)
def test_splitting_two_given_paths_at_their_absolute_path_gives_them_back(seed):
    rng = np.random.default_rng(seed)
    left = random_path(rng, 13)
    right = PosePath(dq.mul(left.dqs, a_gentle_path(rng).dqs))
    beta = rng.uniform()
    again = split(relative_path(left, right), absolute_path(left, right, beta), beta)
    assert_same_pose(again[0].dqs, left.dqs, 1e-12)
    assert_same_pose(again[1].dqs, right.dqs, 1e-12)


@for_all(seeds)
def test_all_of_the_motion_can_be_given_to_one_arm(seed):
    rng = np.random.default_rng(seed)
    rho, absolute = random_path(rng, 8, 0.5), Pose(random_dq(rng))
    left, right = split(rho, absolute, 0.0)
    assert_same_pose(left.dqs, np.broadcast_to(absolute.dq, left.dqs.shape), 0.0)
    assert_same_pose(right.dqs, rho.moved(absolute).dqs, 0.0)
    left, right = split(rho, absolute, 1.0)
    assert_same_pose(right.dqs, np.broadcast_to(absolute.dq, left.dqs.shape), 1e-12)


@for_all(seeds, shares)
def test_two_arms_move_with_the_world(seed, beta):
    rng = np.random.default_rng(seed)
    rho, absolute, world = a_gentle_path(rng), Pose(random_dq(rng)), Pose(random_dq(rng))
    for before, after in zip(split(rho, absolute, beta), split(rho, world @ absolute, beta), strict=True):
        assert_same_pose(after.dqs, before.moved(world).dqs, 1e-12)


@for_all(seeds)
def test_one_arm_reproduces_the_demonstration_and_its_imitation(seed):
    rng = np.random.default_rng(seed)
    pourer, receiver, held = random_path(rng, 20), Pose(random_dq(rng)), Pose(random_dq(rng))
    # the left hand is the receiving object's frame, the right one holds as the demonstrator did
    rho = task_relative_path(
        pourer,
        receiver,
        tool_from_poured=held,
        left_from_receiver=Pose.identity(),
        right_from_poured=held,
    )
    left, right = split(rho, receiver, 0.0)
    assert_same_pose(right.dqs, pourer.dqs, 1e-12)
    goal = Pose(random_dq(rng))
    _, right = split(imitated_path(rho, receiver.inverse() @ goal), receiver, 0.0)
    assert_same_pose(right.dqs, imitated_path(pourer, goal).dqs, 1e-12)
    assert_same_pose(left.dqs[0], receiver.dq, 0.0)


@for_all(seeds)
def test_the_objects_do_the_same_whatever_the_grasps(seed):
    rng = np.random.default_rng(seed)
    pourer = random_path(rng, 15)
    receiver, held, in_left, in_right, place = (Pose(random_dq(rng)) for _ in range(5))
    rho = task_relative_path(
        pourer, receiver, tool_from_poured=held, left_from_receiver=in_left, right_from_poured=in_right
    )
    left, right = split(rho, place, 0.0)
    objects = relative_path(left.with_tool(in_left), right.with_tool(in_right))
    assert_same_pose(objects.dqs, relative_path(receiver, pourer.with_tool(held)).dqs, 1e-12)


@pytest.mark.parametrize("beta", [0.2, 0.5, 0.9])
@pytest.mark.parametrize("last", [3.0, 3.5, 5.5])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_small_relative_steps_are_small_steps_of_both_arms_through_the_half_turn(beta, last, sign):
    rho = PosePath(sign * turning_path(last).dqs)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", HalfTurnPassed)
        left, right = split(rho, Pose.from_yaw([0.2, 0, 1], 0.4), beta)
    assert_same_pose(relative_path(left, right).dqs, rho.dqs, 1e-12)
    for path in (left, right):
        assert (steps(path) <= 6.0 * steps(rho)).all()
        turned, shown = (dq.pose_distance(p.dqs[:-1], p.dqs[1:])[1] for p in (path, rho))
        assert (turned <= shown / np.sin(0.25)).all()


@pytest.mark.parametrize("beta", [0.2, 0.5, 0.9])
def test_each_arm_does_its_part_of_a_long_turn(beta):
    rho = turning_path(5.5, lean=0.0)
    with pytest.warns(HalfTurnPassed):
        paths = split(rho, Pose.identity(), beta)
    for path, part in zip(paths, (beta, 1.0 - beta), strict=True):
        turned = dq.pose_distance(path.dqs[:-1], path.dqs[1:])[1].sum()
        assert turned == pytest.approx(part * 5.3, abs=1e-9)


def test_the_shortest_power_would_jump_where_the_continuous_one_does_not():
    rho = turning_path(3.5)
    shortest = PosePath(dq.power(rho.dqs, 0.5))
    assert steps(shortest).max() > 20 * steps(rho).max()


@for_all(seeds, shares, max_examples=40)
def test_steps_are_bounded_on_random_paths(seed, beta):
    rng = np.random.default_rng(seed)
    rho = a_gentle_path(rng)
    for path in split(rho, Pose.identity(), beta):
        assert (steps(path) <= 4.0 * steps(rho)).all()


def test_the_angle_is_unwrapped_and_passing_a_half_turn_is_said():
    rho = turning_path(5.5)
    np.testing.assert_allclose(turns(rho), np.linspace(0.2, 5.5, 200), rtol=0, atol=1e-12)
    np.testing.assert_allclose(turns(PosePath(-rho.dqs)), turns(rho), rtol=0, atol=0)
    place = Pose.identity()
    with pytest.warns(HalfTurnPassed, match=r"5\.5 rad"):
        split(rho, place, 0.5)
    with pytest.warns(HalfTurnPassed):
        absolute_path(place, rho, 0.5)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        split(rho, place, 0.0)
        split(rho, place, 1.0)
        split(turning_path(3.1), place, 0.5)


def test_near_a_full_turn_only_one_arm_may_do_all():
    rho = turning_path(5.9)
    with pytest.raises(BadOption, match=r"5\.9 rad"):
        split(rho, Pose.identity(), 0.5)
    left, right = split(rho, Pose.identity(), 0.0)
    assert_same_pose(relative_path(left, right).dqs, rho.dqs, 1e-12)


@for_all(seeds, shares)
def test_shared_translation_turns_one_hand_only_and_keeps_the_relative_path(seed, share):
    rng = np.random.default_rng(seed)
    rho, absolute = random_path(rng, 12, 0.4), Pose(random_dq(rng))
    left, right = shared_translation(rho, absolute, share)
    assert_same_pose(relative_path(left, right).dqs, rho.dqs, 1e-12)
    assert_same_pose(left.dqs[-1], absolute.dq, 1e-12)
    np.testing.assert_allclose(dq.pose_distance(left.dqs, absolute.dq)[1], 0.0, atol=1e-12)
    apart = (rho.positions - rho.positions[-1]) @ absolute.rotation.T
    np.testing.assert_allclose(left.positions - left.positions[-1], -share * apart, rtol=0, atol=1e-12)
    np.testing.assert_allclose(right.positions - right.positions[-1], (1 - share) * apart, rtol=0, atol=1e-12)


def test_shared_translation_keeps_an_upright_glass_upright_and_half_the_screw_does_not():
    rho, absolute = turning_path(2.0, lean=1.5), Pose.from_yaw([0.2, 0, 1.3], 1.2)
    assert max(pose.tilt for pose in shared_translation(rho, absolute)[0]) < 1e-12
    assert max(pose.tilt for pose in split(rho, absolute, 0.5)[0]) > 0.1


def two_arms(seed):
    rng = np.random.default_rng(seed)
    arms = random_arm(seed, 7), random_arm(seed + 1, 6)
    return rng, arms, [joints(arm, rng) for arm in arms]


@for_all(seeds, max_examples=50)
def test_the_relative_jacobian_is_the_derivative_of_the_relative_pose(seed):
    rng, (left, right), q = two_arms(seed)
    speed, h = [rng.normal(size=arm.dof) for arm in (left, right)], 1e-6

    def rho(t):
        x = [arm.fk_jacobian(q[k] + t * speed[k])[0] for k, arm in enumerate((left, right))]
        return dq.mul(dq.conj(x[0]), x[1])

    arguments = (*left.fk_jacobian(q[0]), *right.fk_jacobian(q[1]))
    jacobian, both = relative_jacobian(*arguments), np.concatenate(speed)
    assert jacobian.shape == (8, 13)
    np.testing.assert_allclose(jacobian @ both, (rho(h) - rho(-h)) / (2 * h), rtol=0, atol=1e-7)
    twist = dq.twist_from_dq(dq.mul(dq.conj(rho(-h)), rho(h))) / (2 * h)
    np.testing.assert_allclose(relative_twist_jacobian(*arguments) @ both, twist, rtol=0, atol=1e-7)


@for_all(seeds, max_examples=50)
def test_the_twist_form_is_the_right_twist_less_the_left_one_carried_over(seed):
    _, (left, right), q = two_arms(seed)
    x_left, j_left = left.fk_jacobian(q[0])
    x_right, j_right = right.fk_jacobian(q[1])
    seen = (Pose(x_right).inverse() @ Pose(x_left)).matrix
    turn, (x, y, z) = seen[:3, :3], seen[:3, 3]
    carry = np.block([[turn, np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]]) @ turn], [np.zeros((3, 3)), turn]])
    expected = np.concatenate([-carry @ j_left, j_right], axis=1)
    jacobian = relative_twist_jacobian(x_left, j_left, x_right, j_right)
    np.testing.assert_allclose(jacobian, expected, rtol=0, atol=1e-12)


def test_moving_both_arms_as_one_body_changes_nothing_relative():
    rng = np.random.default_rng(5)
    x_left, x_right = random_dq(rng, 2)
    # the world's six twists, seen from each hand
    bodies = []
    for x in (x_left, x_right):
        pure = np.zeros((6, 8))
        pure[[0, 1, 2], [5, 6, 7]] = pure[[3, 4, 5], [1, 2, 3]] = 1.0
        seen = dq.mul(dq.mul(dq.conj(x), pure), x)
        bodies.append(np.concatenate([seen[:, 5:], seen[:, 1:4]], axis=1).T)
    jacobian = relative_jacobian(x_left, bodies[0], x_right, bodies[1])
    np.testing.assert_allclose(jacobian[:, :6] + jacobian[:, 6:], 0.0, rtol=0, atol=1e-13)


@pytest.mark.parametrize("share", [-0.1, 1.1, np.nan])
def test_a_share_outside_zero_and_one_is_refused(share):
    rho = turning_path(1.0)
    with pytest.raises(BadOption, match="beta"):
        split(rho, Pose.identity(), share)
    with pytest.raises(BadOption, match="beta"):
        absolute_path(rho, rho, share)
    with pytest.raises(BadOption, match="share"):
        shared_translation(rho, Pose.identity(), share)


def test_paths_of_different_length_and_wrong_jacobians_are_refused():
    rho = turning_path(1.0)
    with pytest.raises(BadShape, match="left path"):
        relative_path(rho[:5], rho)
    with pytest.raises(BadShape, match="absolute path"):
        split(rho, rho[:5], 0.5)
    with pytest.raises(BadShape, match="right Jacobian"):
        relative_jacobian(rho.dqs[0], np.zeros((6, 7)), rho.dqs[1], np.zeros((7, 6)))
