"""What each baseline motion is, and is not: properties of the paths, and an independent judge of the joints."""

from __future__ import annotations

import numpy as np
import pytest
from helpers.policies import PROGRAMS, installed
from helpers.random_scenes import at, demonstrated, judged, panda, problem

from onedemo.baselines import extras
from onedemo.baselines.errors import MissingExtra
from onedemo.baselines.factory import settings_of
from onedemo.baselines.motion.generated_follower import GeneratedFollower
from onedemo.baselines.motion.generated_plan import NO_PATH, PATH
from onedemo.baselines.motion.tool_obstacles import ToolObstacles
from onedemo.baselines.paths_only import PATH_MAKERS, made_path, motion_planner
from onedemo.configs.errors import BadConfig
from onedemo.planner.errors import PlanFailed, UnknownName
from onedemo.planner.escape.repet import clear_of, point_tool
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Obstacle, Sphere
from onedemo.planner.imitation.tsia import final_path, guide_index, imitated_path
from onedemo.planner.planning.planning_scene import PlanningScene, SceneTemplate
from onedemo.planner.reactive.command import ReactiveSettings
from onedemo.planner.safety.safety_layer import SafetySettings

TOOL = point_tool(0.05)
PLACE = at([0.05, 0.3, 1.0]) @ at([0, 0, 0], demonstrated()[-1].quaternion)
MOVED = at([0.3, -0.2, 0.1], [np.cos(0.4), 0.0, 0.0, np.sin(0.4)])


each_maker = pytest.mark.parametrize("name", installed(*PATH_MAKERS))


def start_of(goal=PLACE):
    return at([-0.2, -0.15, 0.2]) @ goal


def path_of(name, start=None, goal=PLACE, shown=None, **options):
    return made_path(name, shown or demonstrated(), start or start_of(goal), goal, tool=TOOL, **options)


def worst(one: PosePath, other: PosePath) -> float:
    """Largest distance [m], or a fifth of the angle, between poses of two paths; inf if they differ in number."""
    if len(one) != len(other):
        return np.inf
    gaps = np.array([a.distance_to(b) for a, b in zip(one, other, strict=True)])
    return float(np.max(gaps * [1.0, 0.2]))


def in_the_way(path: PosePath, radius=0.04) -> Obstacle:
    """A ball beside the middle of a path, overlapping the tool there."""
    middle = path.positions[len(path) // 3]
    return Obstacle(Sphere(radius), at(middle + np.array([0.0, 0.02, 0.01])), name="ball")


def test_what_makes_paths_is_every_policy_but_the_sampler():
    assert set(PROGRAMS) - set(PATH_MAKERS) == {"rrt"}
    with pytest.raises(UnknownName, match="path maker 'rrt'"):
        path_of("rrt")


@each_maker
def test_paths_begin_at_the_start_and_end_at_the_goal(name):
    path = path_of(name)
    for pose, wanted in ((path[0], start_of()), (path[-1], PLACE)):
        distance, angle = pose.distance_to(wanted)
        assert distance < 1e-9 and angle < 1e-7
    steps = np.linalg.norm(np.diff(path.positions, axis=0), axis=1)
    assert steps.max() < 0.03


@each_maker
def test_moving_the_world_moves_the_path(name):
    ball = in_the_way(path_of("screw-guard-only"))
    there = Obstacle(ball.shape, MOVED @ ball.pose, name="ball")
    one = path_of(name, obstacles=[ball]).moved(MOVED)
    # the trees' planes follow the axes of the world
    if name in ("screw", "screw-no-guard", "screw-ee-only"):
        one, there = path_of(name).moved(MOVED), Obstacle(ball.shape, at([5.0, 0.0, 0.0]))
    other = path_of(name, MOVED @ start_of(), MOVED @ PLACE, demonstrated().moved(MOVED), obstacles=[there])
    assert worst(one, other) < 1e-6


@pytest.mark.parametrize("name", installed("dmp-goal", "dmp-world"))
def test_only_in_the_goals_frame_a_primitive_turns_with_the_goal(name):
    one, other = path_of(name).moved(MOVED), path_of(name, MOVED @ start_of(), MOVED @ PLACE)
    assert (worst(one, other) < 1e-6) == (name == "dmp-goal")
    aside = at([0.1, 0.2, 0.0])
    assert worst(path_of(name).moved(aside), path_of(name, aside @ start_of(), aside @ PLACE)) < 1e-6


@pytest.mark.parametrize("name, same", [("screw-guard-only", True), ("decoupled", False), ("replay", False)])
def test_another_frame_on_the_tool_changes_what_is_no_screw(name, same):
    tool = at([0.1, 0.0, 0.05], [np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0])
    start = at([-0.2, -0.1, 0.1], [0.9, 0.1, 0.3, np.sqrt(1 - 0.91)]) @ PLACE
    last = {"settings": {"motion": {"guide": 1.0, "max_guide": 1.0}}}
    one = path_of(name, start, **last).with_tool(tool)
    other = path_of(name, start @ tool, PLACE @ tool, demonstrated().with_tool(tool), **last)
    # in steps of their own along the same curve, or not
    off = max(np.linalg.norm(other.positions - each, axis=1).min() for each in one.positions)
    assert (off < 0.006) == same


def turned(angle):
    return at([0, 0, 0], [np.cos(angle / 2), 0.0, np.sin(angle / 2), 0.0])


@pytest.mark.parametrize(
    "between, same",
    [
        (at([0.2, -0.1, 0.15]), True),
        (turned(0.9), True),
        (at([0.2, -0.1, 0.15]) @ turned(0.9), False),
    ],
    ids=["slide", "turn about the tcp", "both"],
)
def test_decoupled_is_the_screw_where_only_one_of_both_moves(between, same):
    imitated = imitated_path(demonstrated(), PLACE)
    guiding = imitated[guide_index(imitated, settings_of("decoupled").motion.guide)]
    start = guiding @ between
    gap = worst(path_of("decoupled", start), path_of("screw-guard-only", start))
    assert (gap < 1e-9) == same
    if not same:
        assert gap > 0.01


def test_replay_keeps_every_relative_motion_of_the_demonstration():
    shown, path = demonstrated(), path_of("replay")
    tail = path[len(path) - len(shown) :]
    for k in range(len(shown) - 1):
        distance, angle = (tail[k].inverse() @ tail[k + 1]).distance_to(shown[k].inverse() @ shown[k + 1])
        assert distance < 1e-12 and angle < 1e-7
    way = path.positions[: len(path) - len(shown) + 1]
    straight = way[0] + np.linspace(0, 1, len(way))[:, None] * (way[-1] - way[0])
    np.testing.assert_allclose(way, straight, atol=1e-12)


@pytest.mark.parametrize("name", installed("dmp-goal", "dmp-world", "replay"))
def test_from_the_demonstrated_start_to_the_demonstrated_goal_it_is_the_demonstration(name):
    shown = demonstrated()
    path = path_of(name, shown[0], shown[-1])
    for pose in path:
        gaps = np.array([pose.distance_to(other) for other in shown])
        assert gaps[:, 0].min() < 0.006 and gaps[np.argmin(gaps[:, 0]), 1] < 0.05
    for pose in shown:
        assert min(pose.distance_to(other)[0] for other in path) < 0.012


def test_without_obstacles_nearby_the_potential_path_is_tsia_bit_by_bit():
    settings = settings_of("potential")
    imitated = imitated_path(demonstrated(), PLACE)
    wanted = final_path(start_of(), imitated, guide_index(imitated, settings.motion.guide))
    far = Obstacle(Sphere(0.05), at([0.0, 0.0, 5.0]))
    for obstacles in ([], [far]):
        np.testing.assert_array_equal(path_of("potential", obstacles=obstacles).dqs, wanted.dqs)


def test_the_field_leads_round_a_ball_and_back_to_the_reference():
    ball = in_the_way(path_of("screw-guard-only"))
    free, led = path_of("screw-guard-only"), path_of("potential", obstacles=[ball])
    assert min(clear_of(pose, TOOL, [ball]) for pose in free) < 0.0
    assert min(clear_of(pose, TOOL, [ball]) for pose in led) > 0.0
    assert led[-1].distance_to(PLACE)[0] < 1e-9
    assert min(np.abs(led[-2].dq - pose.dq).max() for pose in free) < 1e-3


def test_in_a_pocket_the_field_has_a_minimum_and_says_so():
    """Four balls close the way; the reference goes on beyond them and pulls straight into the pocket between."""
    start, goal = at([-0.4, 0.0, 0.0]) @ PLACE, PLACE
    still = PosePath(goal.dq[None])
    corners = [np.array([-0.2, side, lift]) for side in (-0.1, 0.1) for lift in (-0.1, 0.1)]
    pocket = [Obstacle(Sphere(0.12), at(PLACE.position + corner)) for corner in corners]
    path = path_of("potential", start, goal, still, obstacles=pocket)
    assert path[-1].distance_to(goal)[0] > 0.05
    assert min(clear_of(pose, TOOL, pocket) for pose in path) > -1e-3


@pytest.mark.parametrize("name", installed("potential", "dmp-goal"))
def test_what_appears_changes_only_what_is_still_to_come(name):
    generator, shown = settings_of(name).generator, demonstrated()
    nothing = ToolObstacles(TOOL, ())
    made = generator.make(shown, start_of(), PLACE, 20, nothing)
    middle = len(made.path) // 3
    again = generator.renewed(made, middle, nothing)
    np.testing.assert_allclose(again.path.dqs, made.path.dqs, atol=1e-12)
    ahead = Obstacle(Sphere(0.03), at(made.path.positions[middle + 15] + [0.0, 0.03, 0.01]))
    led = generator.renewed(made, middle, ToolObstacles(TOOL, [ahead])).path
    np.testing.assert_array_equal(led.dqs[: middle + 1], made.path.dqs[: middle + 1])
    after = min(len(led), len(made.path))
    assert np.abs(led.positions[:after] - made.path.positions[:after]).max() > 0.005
    assert min(clear_of(pose, TOOL, [ahead]) for pose in led) > min(clear_of(p, TOOL, [ahead]) for p in made.path)


def planned(name, obstacles=(), settings=None):
    arm, body, home = panda()
    return motion_planner(name, arm, body, settings).plan(demonstrated(), home, PLACE, obstacles)


@pytest.mark.parametrize("name", installed(*PROGRAMS))
def test_every_policy_plans_a_leg_that_its_arm_can_follow(name):
    plan = planned(name)
    arm, _, home = panda()
    assert plan.success, plan.why
    np.testing.assert_array_equal(plan.joints[0], home)
    distance, angle = arm.fk(plan.joints[-1]).distance_to(PLACE)
    assert distance < 2e-3 and angle < 0.02
    speeds = np.abs(np.diff(plan.joints, axis=0)) / plan.dt
    assert (speeds <= arm.velocity_limits * (1 + 1e-9)).all()


@pytest.mark.parametrize("name", installed("rrt"))
@pytest.mark.parametrize("kind, seed", [("convex", 3), ("clutter", 1), ("gap", 2), ("held", 4)])
def test_the_samplers_joints_are_clear_for_an_independent_judge(name, kind, seed):
    scene = problem(kind, seed)
    arm, _, _ = panda()
    planner = motion_planner(name, arm, scene.body)
    plan = planner.plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    assert plan.success, plan.why
    certificate = judged(scene, plan)
    assert certificate.ok, certificate.reasons
    again = planner.plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    np.testing.assert_array_equal(plan.joints, again.joints)


@pytest.mark.parametrize("name", installed("rrt"))
def test_the_sampler_gives_up_after_its_budget(name):
    scene = problem("cage", 0)
    arm, _, _ = panda()
    tight = motion_planner(name, arm, scene.body, {"sampling": {"budget": 200, "approach": 0.0}})
    plan = tight.plan(demonstrated(), scene.start, scene.goal, scene.obstacles)
    assert not plan.success and len(plan.joints) == 1


def smallest_room(plan, ball) -> float:
    """Distance [m] of the whole arm from a ball on the way, less a millimeter for the ticks between."""
    scene = PlanningScene(SceneTemplate(plan.arm, plan.body, SafetySettings(distance=0.0), plan.dt), [ball], 0.0)
    return min(scene.slack(q) for q in plan.joints)


@pytest.mark.parametrize("name", ["decoupled", "replay"])
def test_a_guard_is_off_unless_it_is_asked_for(name):
    arm, _, _ = panda()
    free = planned(name)
    ball = Obstacle(Sphere(0.05), at(arm.fk(free.joints[len(free.joints) // 2]).position), name="ball")
    blind = planned(name, [ball])
    assert blind.success and blind.changed == 0 and smallest_room(blind, ball) < 0.0
    if name == "replay":
        assert blind.imitated_share < 1.0
    guarded = planned(name, [ball], {"guard": True})
    if guarded.success:
        assert smallest_room(guarded, ball) > 0.0
    else:
        assert guarded.reason in ("ik_or_limit", "goal in collision")


@pytest.mark.parametrize(
    "name, setting",
    [
        ("screw-trees-only", "search"),
        ("screw-search-only", "trees"),
        ("screw-no-guard", "guard"),
        ("screw-ee-only", "whole_arm"),
    ],
)
def test_an_ablation_is_the_method_with_one_setting(name, setting):
    kept = {"motion", "safety", "resample", "trim", "repet", "trees", "search", "guard", "whole_arm"} - {setting}
    one, other = settings_of(name), settings_of("screw")
    assert not getattr(one, setting) and getattr(other, setting)
    assert all(getattr(one, key) == getattr(other, key) for key in kept)
    assert getattr(settings_of(name, {setting: True}), setting)


def test_without_the_guard_the_method_still_leads_its_hand_round():
    arm, _, _ = panda()
    seen = 0
    for seed in range(12):
        if seen == 2:
            return
        scene = problem("convex", seed)
        plan = motion_planner("screw-no-guard", arm, scene.body).plan(
            demonstrated(), scene.start, scene.goal, scene.obstacles
        )
        if plan.success and plan.how == "escape":
            seen += 1
            tool = scene.body.tool(arm)
            assert min(clear_of(arm.fk(q), tool, scene.obstacles) for q in plan.joints) > 0.0
    pytest.fail("hardly a detour in a dozen scenes")


def test_a_path_that_ends_before_the_goal_is_no_plan():
    ball = Obstacle(Sphere(0.06), PLACE, name="ball")
    plan = planned("potential", [ball])
    if not plan.success:
        assert plan.reason in (NO_PATH, "ik_or_limit") and len(plan.joints) == 1


@pytest.mark.parametrize("name", ["replay", "potential"])
def test_a_generated_path_is_followed_even_if_planning_did_not_follow_it(name):
    """Its closed loop may still arrive; a failed plan of the method has no path to follow."""
    arm, body, home = panda()
    far = motion_planner(name, arm, body, None).plan(demonstrated(), home, at([2.0, 0.0, 0.0]) @ PLACE)
    assert not far.success and far.how == PATH
    follower = GeneratedFollower(arm, body, ReactiveSettings(), settings_of(name).generator)
    follower.follow(far)
    assert follower.step(home).state == "following"
    with pytest.raises(PlanFailed, match="plan_failed"):
        follower.follow(far._replace(how="direct"))


def test_a_blocked_path_of_the_method_is_a_reason():
    with pytest.raises(PlanFailed, match="blocked"):
        path_of("screw", obstacles=[Obstacle(Sphere(0.06), PLACE, name="ball")])


@pytest.mark.parametrize("name, extra", [("dmp-goal", "dmp"), ("dmp-world", "dmp"), ("rrt", "ompl")])
def test_a_missing_library_is_one_line_with_its_extra(name, extra, monkeypatch):
    def absent(module):
        raise ImportError(f"No module named {module!r}")

    monkeypatch.setattr(extras, "import_module", absent)
    with pytest.raises(MissingExtra, match=rf"^\w+ is needed \(No module.*\): pip install 'onedemo\[{extra}\]'$"):
        planned(name)


@pytest.mark.parametrize(
    "name, settings, message",
    [
        ("potential", {"field": {"pull": 2.0}}, "field.pull: 2.0 is not in"),
        ("potential", {"repet": {}}, "repet: unknown key; did you mean 'resample'. allowed: motion, safety"),
        ("dmp-goal", {"dmp": {"weights": 1}}, "dmp.weights: 1 is not from 2"),
        ("dmp-goal", {"dmp": {"gama": 1}}, "dmp.gama: unknown key; did you mean 'gamma'. allowed: weights"),
        ("rrt", {"sampling": {"budget": 0}}, "sampling.budget: 0 is not from 1"),
        ("rrt", {"sampling": {"step": 0.0}}, "sampling.step: 0.0 is not a positive number"),
    ],
)
def test_bad_settings_are_named(name, settings, message):
    with pytest.raises(BadConfig, match=message):
        settings_of(name, settings)


def test_the_tool_near_two_obstacles_is_asked_for_each():
    ball, board = (
        Obstacle(Sphere(0.02), at([0.1, 0.0, 0.0])),
        Obstacle(Sphere(0.02), at([0.0, 0.075, 0.0]), margin=0.001),
    )
    near = ToolObstacles(TOOL, [ball, board]).at(np.zeros(3), np.array([1.0, 0.0, 0.0, 0.0]), 0.1)
    assert [each.reach for each in sorted(near, key=lambda each: each.slack)] == [0.01, 0.1]
    first = max(near, key=lambda each: each.slack)
    assert first.slack == pytest.approx(0.03, abs=1e-9)
    np.testing.assert_allclose(first.normal, [-1.0, 0.0, 0.0], atol=1e-9)
    assert Pose.from_position_quaternion(first.normal).position[0] == -1.0
