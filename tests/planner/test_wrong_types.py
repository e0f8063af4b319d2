"""An argument of a wrong class is refused by one of the project's errors, in one line: every argument, every entry."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import fields
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pytest
from helpers.random_scenes import at, panda

import onedemo
from onedemo import planner as face
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.control.pursuit import Pursuit, PursuitSettings
from onedemo.planner.errors import OneDemoError
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.planning.settings import JointSearchSettings

WRONG = {
    "None": None,
    "int": 5,
    "text": "x",
    "object": object(),
    "list": [1],
    "set": {1},
    "map": {"x": 1},
    "class": int,
}
ARM, BODY, HOME = panda()
START = ARM.fk(HOME)
GOAL = at([0.0, 0.1, 0.05]) @ START
PATH = screw_path(START, GOAL, 0.02)
BALL = face.Obstacle(face.Sphere(0.04), at([0.0, 0.0, 5.0]), name="ball")
QUICK = face.PlanSettings(search=None)
TIME = np.linspace(0.0, 1.0, len(PATH))
SETTINGS = (
    face.ControllerSettings, face.MotionSettings, face.PlanSettings, face.ReactiveSettings, face.RepetSettings,
    face.SafetySettings, JointSearchSettings, PursuitSettings,
)  # fmt: skip


class Entry(NamedTuple):
    """A public call with good arguments, all of which are tried."""

    call: Callable[..., Any]
    good: Mapping[str, Any]


def plan() -> face.Plan:
    return face.Planner(ARM, BODY, QUICK).plan(PATH, HOME, GOAL)


def shown(**change) -> face.Demonstration:
    good = {
        "name": "shown", "task": "", "robot": "Panda", "tcp_frame": "tcp", "source": "scripted", "licence": "MIT",
        "time": TIME, "path": PATH, "joint_positions": np.tile(HOME, (len(PATH), 1)), "gripper": TIME,
        "segments": (face.Segment("carry", 0, 3),), "object_sizes": {},
    }  # fmt: skip
    return face.Demonstration(**{**good, **change})


def steps(action: Callable[[face.ReactivePlanner], Any]) -> None:
    follower = face.ReactivePlanner(ARM, BODY, face.ReactiveSettings(plan=QUICK))
    action(follower)
    follower.step(HOME)


def entries(folder) -> dict[str, Entry]:
    """All public calls of the planner, by name."""
    file, log = folder / "shown.npz", folder / "log.json"
    face.save_demonstration(shown(), file)
    face.write_log(plan().log(), log)
    planner = face.Planner(ARM, BODY, QUICK)
    request = {
        "start": HOME, "goal": GOAL, "obstacles": [BALL], "allowed": [("hand", "ball")], "leaving": PATH,
        "next_motion": face.NextMotion(PATH), "seed": 0,
    }  # fmt: skip
    arm = {"arm": ARM, "body": BODY, "settings": QUICK}
    return {
        "Arm": Entry(face.Arm, {f.name: getattr(ARM, f.name) for f in fields(face.Arm)}),
        "Arm.fk": Entry(ARM.fk, {"q": HOME}),
        "Arm.with_tool": Entry(ARM.with_tool, {"tcp_from_tool": GOAL}),
        "Body": Entry(face.Body, {"rows": BODY.rows, "names": BODY.names}),
        "Body.holding": Entry(
            BODY.holding, {"name": "held", "shape": face.Sphere(0.02), "tcp_from_object": GOAL, "arm": ARM}
        ),
        "Pose": Entry(face.Pose, {"dq": GOAL.dq}),
        "Pose.from_vector": Entry(face.Pose.from_vector, {"vector": GOAL.vector}),
        "Pose.from_yaw": Entry(face.Pose.from_yaw, {"position": [0.0, 0.0, 0.0], "yaw": 0.1}),
        "PosePath": Entry(face.PosePath, {"dqs": PATH.dqs}),
        "Sphere": Entry(face.Sphere, {"radius": 0.1}),
        "Capsule": Entry(face.Capsule, {"radius": 0.1, "length": 0.1}),
        "Cylinder": Entry(face.Cylinder, {"radius": 0.1, "length": 0.1}),
        "Box": Entry(face.Box, {"size": (0.1, 0.1, 0.1)}),
        "Mesh": Entry(face.Mesh, {"vertices": np.eye(4)[:, :3]}),
        "Obstacle": Entry(
            face.Obstacle,
            {"shape": face.Sphere(0.1), "pose": GOAL, "velocity": np.zeros(3), "name": "ball", "margin": 0.01},
        ),
        "Controller": Entry(
            lambda arm, settings, q, target: face.Controller(arm, settings)(q, target),
            {"arm": ARM, "settings": face.ControllerSettings(), "q": HOME, "target": GOAL},
        ),
        "Pursuit": Entry(
            lambda q, **given: Pursuit(**given).step(q),
            {
                "arm": ARM,
                "path": PATH,
                "dt": 0.02,
                "q": HOME,
                "controller": face.ControllerSettings(),
                "settings": PursuitSettings(),
            },
        ),
        "inverse_kinematics": Entry(inverse_kinematics, {"arm": ARM, "target": GOAL, "seed": HOME, "iterations": 9}),
        "Planner": Entry(face.Planner, arm),
        "Planner.hold": Entry(planner.hold, {"body": BODY}),
        "Planner.plan": Entry(planner.plan, {"demonstrated": PATH, "segment": None, **request}),
        "Planner.plan of a segment": Entry(
            planner.plan, {"demonstrated": shown(), "segment": "carry", "start": HOME, "goal": GOAL}
        ),
        "PlanRequest": Entry(
            lambda **given: planner.answer(face.PlanRequest(**given)), {"demonstrated": PATH, **request}
        ),
        "NextMotion": Entry(
            lambda **given: planner.plan(PATH, HOME, GOAL, next_motion=face.NextMotion(**given)),
            {"path": PATH, "allowed": (), "required": True},
        ),
        "plan_batch": Entry(face.plan_batch, {"requests": [face.PlanRequest(PATH, HOME, GOAL)], "workers": 1, **arm}),
        "ReactivePlanner": Entry(face.ReactivePlanner, {**arm, "settings": face.ReactiveSettings()}),
        "ReactivePlanner.see": Entry(
            lambda **given: steps(lambda follower: follower.see(**given)),
            {"obstacles": [BALL], "allowed": [("hand", "ball")]},
        ),
        "ReactivePlanner.go": Entry(
            lambda **given: steps(lambda follower: follower.go(**given)),
            {"path": PATH, "exact": True, "next_motion": face.NextMotion(PATH), "detours": True},
        ),
        "ReactivePlanner.follow": Entry(lambda plan: steps(lambda follower: follower.follow(plan)), {"plan": plan()}),
        "ReactivePlanner.step": Entry(face.ReactivePlanner(ARM, BODY).step, {"q": HOME}),
        "SafetyLayer": Entry(
            lambda q, velocity, **given: face.SafetyLayer(**given)(q, velocity),
            {
                "arms": [ARM],
                "bodies": [BODY],
                "obstacles": [BALL],
                "dt": 0.02,
                "settings": face.SafetySettings(),
                "allowed": [("hand", "ball")],
                "pairs": [(0, 5)],
                "q": HOME,
                "velocity": np.zeros(7),
            },
        ),
        "escape_path": Entry(
            face.escape_path,
            {
                "path": PATH,
                "tool": BODY.tool(ARM),
                "obstacles": [BALL],
                "settings": face.RepetSettings(),
                "masks": [0],
                "seed": 0,
            },
        ),
        "EscapeTree.from_rows": Entry(face.EscapeTree.from_rows, {"rows": np.zeros((1, 21))}),
        "imitated_path": Entry(face.imitated_path, {"demonstrated": PATH, "goal": GOAL}),
        "final_path": Entry(face.final_path, {"start": START, "imitated": PATH, "guide": 1}),
        "guide_index": Entry(face.guide_index, {"path": PATH, "fraction": 0.2, "by": "length"}),
        "smoothed": Entry(face.smoothed, {"plan": plan(), "tolerance": 0.002}),
        "timed": Entry(face.timed, {"plan": plan(), "acceleration_limits": 5.0}),
        "MotionLog": Entry(
            face.MotionLog,
            {
                "arm": ARM,
                "body": BODY,
                "obstacles": (BALL,),
                "time": TIME,
                "joints": np.tile(HOME, (len(PATH), 1)),
                "safety": 0.01,
                "goal": GOAL,
                "demonstrated": PATH,
                "allowed": [("hand", "ball")],
                "claims": {"clearance": 0.1},
                "format_version": 1,
            },
        ),
        "certify": Entry(
            face.certify, {"log": plan().log(), "expected": plan().log(), "tolerance": 1e-6, "settings": None}
        ),
        "read_log": Entry(face.read_log, {"path": log}),
        "write_log": Entry(face.write_log, {"log": plan().log(), "path": log}),
        "Segment": Entry(
            lambda **given: shown(segments=(face.Segment(**given),)),
            {
                "name": "carry",
                "start": 0,
                "stop": 3,
                "reference": "",
                "reference_pose": GOAL,
                "held": "",
                "gripper": "none",
            },
        ),
        "Demonstration": Entry(shown, {f.name: getattr(shown(), f.name) for f in fields(face.Demonstration)}),
        "Demonstration.segment_path": Entry(shown().segment_path, {"name": "carry"}),
        "read_demonstration": Entry(face.read_demonstration, {"path": file}),
        "save_demonstration": Entry(face.save_demonstration, {"demonstration": shown(), "path": file}),
        "load_demonstration": Entry(onedemo.load_demonstration, {"name": file}),
        **{kind.__name__: Entry(kind, {f.name: getattr(kind(), f.name) for f in fields(kind)}) for kind in SETTINGS},
    }


UNTRIED = {"Certificate", "Command", "Plan", "Shape", "body_from_mujoco", "body_from_urdf"}
"""Results, which nobody makes; the base of the shapes; readers of models, which have tests of their own."""


@pytest.fixture(scope="module")
def known(tmp_path_factory) -> dict[str, Entry]:
    return entries(tmp_path_factory.mktemp("files"))


def test_every_public_name_is_tried(known):
    tried = {name.split(".")[0].split(" ")[0] for name in known}
    assert set(face.__all__) - tried == UNTRIED


def outcome(call: Callable[[], Any]) -> str:
    """What a call ends in: "" if it is an answer, or one of the project's errors in one line."""
    try:
        call()
    except OneDemoError as error:
        return "" if "\n" not in str(error) else f"several lines: {error}"
    except Exception as error:
        return f"{type(error).__name__}: {error}"
    return ""


def test_a_wrong_class_is_refused_in_one_line(known, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)  # a text is a fine name of a file to write
    found = {}
    for name, entry in known.items():
        assert outcome(partial(entry.call, **entry.good)) == "", name
        for key in entry.good:
            for kind, wrong in WRONG.items():
                said = outcome(partial(entry.call, **{**entry.good, key: wrong}))
                if said:
                    found[f"{name}({key}={kind})"] = said
    assert found == {}
