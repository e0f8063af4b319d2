"""One arm keeps clear of itself: planned, guarded, and as MuJoCo sees it."""

from __future__ import annotations

import mujoco
import numpy as np
import pytest
from helpers.random_scenes import SETTINGS, demonstrated, panda, problem, solve

from onedemo.planner.collision.self_collision import body_pairs
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.robot.resting_pairs import resting_pairs

OWN = (1, 2)
"""Numbers of the arm's and the fingers' geoms in a simulated scene."""
FOLDED = np.array([1.22, 1.17, -2.16, -2.73, 2.41, 0.67, -0.48])
"""The hand on the forearm [rad]: a search in joint space once led there."""


def simulated():
    """The robot as the tasks simulate it, where its simulator is installed."""
    pytest.importorskip("robosuite")
    from onedemo.envs import ROBOTS
    from onedemo.envs.scene import scene

    assert OWN == (scene.ARM, scene.FINGERS)
    return scene.compiled_scene(ROBOTS["Panda"])


def contacts_with_itself(q):
    """Pairs of geoms of the robot that MuJoCo says touch at joints q (7,)."""
    scene = simulated()
    data = mujoco.MjData(scene.model)
    data.qpos[scene.arms[0].qpos] = q
    data.qpos[scene.arms[0].finger_qpos] = scene.arms[0].finger_open
    mujoco.mj_forward(scene.model, data)
    pairs = data.contact.geom[: data.ncon]
    return [pair for pair in pairs if np.isin(scene.owner[pair], OWN).all() and not within_gripper(pair)]


def within_gripper(pair):
    model = simulated().model
    return all("gripper" in model.body(int(body)).name for body in model.geom_bodyid[pair])


def test_a_hand_on_its_forearm_is_a_collision_for_both():
    arm, body, _ = panda()
    assert contacts_with_itself(FOLDED)
    room = PlanningScene.of(arm, body, (), SETTINGS)
    assert room.slack(FOLDED) < 0.0
    plan = Planner(arm, body).plan(demonstrated(), FOLDED, demonstrated()[-1])
    assert plan.reason == "start in collision" and "link5" in plan.detail and "hand" in plan.detail


def test_where_the_planner_has_room_mujoco_has_no_contact():
    """The capsules contain the links: of 1500 postures none that is clear for the planner touches for MuJoCo."""
    arm, body, _ = panda()
    scene, rng = PlanningScene.of(arm, body, (), SETTINGS), np.random.default_rng(0)
    clear = [q for q in rng.uniform(arm.lower, arm.upper, (1500, 7)) if scene.slack(q) >= 0.0]
    assert len(clear) > 500
    assert not [q for q in clear if contacts_with_itself(q)]


@pytest.mark.parametrize("kind", ["gap", "clutter"])
def test_plans_do_not_touch_the_arm_itself(kind):
    for seed in range(6):
        found = solve(problem(kind, seed))
        assert not any(contacts_with_itself(q) for q in found.joints[::5]), seed


def test_pairs_are_looked_at_or_rest_and_neighbors_always_rest():
    arm, body, home = panda()
    looked, rest = set(body_pairs(arm, body, 0.01)), set(resting_pairs(arm, body, 0.01))
    n = len(body)
    assert not looked & rest and len(looked) + len(rest) == n * (n - 1) // 2
    names = {(body.names[i], body.names[j]) for i, j in looked}
    assert {("link5", "hand"), ("link0", "hand"), ("link2", "fingers")} <= names
    assert not any(abs(i - j) <= 1 for i, j in looked if body.rows[i, 0] == body.rows[j, 0])
    assert PlanningScene.of(arm, body, (), SETTINGS).slack(home) > 0.0
