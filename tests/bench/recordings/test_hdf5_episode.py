"""Episodes of robosuite and robomimic: played through the model they hold, without its meshes."""

from __future__ import annotations

import json

import h5py
import mujoco
import numpy as np
import pytest

from onedemo.bench.recordings.hdf5_episode import recording_from_hdf5
from onedemo.planner.errors import BadDemonstration, OneDemoError, UnknownName

MODEL = """<mujoco><compiler meshdir="/not/here" angle="radian"/>
<asset><mesh name="link" file="gone.stl"/><material name="steel"/></asset><option integrator="RK4"/>
<default><geom material="steel"/></default>
<worldbody><light pos="0 0 3"/><body name="table" pos="0 0 0.4"><geom type="box" size="1 1 0.01"/></body>
<body name="robot0_base" pos="-0.5 0 0.4"><geom type="mesh" mesh="link"/>
 <body name="l1" pos="0 0 0.2"><joint name="robot0_joint1" axis="0 0 1"/><geom type="mesh" mesh="link"/>
  <body name="l2" pos="0.3 0 0"><joint name="robot0_joint2" axis="0 1 0"/><geom size="0.05"/>
   <body name="hand" pos="0.2 0 0"><site name="gripper0_grip_site" pos="0.1 0 0" material="steel"/>
    <body name="finger"><joint name="gripper0_finger_joint1" type="slide" axis="0 1 0"/><geom size="0.01"/></body>
   </body></body></body></body>
<body name="cube_main" pos="0 0 0.5"><freejoint name="cube_joint0"/><geom type="box" size="0.02 0.02 0.02"/></body>
<body name="door" pos="0.6 0 0.5"><joint name="hinge" axis="0 0 1"/><geom type="box" size="0.02 0.2 0.2"/></body>
</worldbody><actuator><motor joint="robot0_joint1"/></actuator><sensor><jointpos joint="hinge"/></sensor></mujoco>"""
COUNT = 20
OSC = {
    "env_kwargs": {
        "controller_configs": {"body_parts": {"right": {"type": "OSC_POSE", "output_max": [0.1] * 3 + [0.5] * 3}}}
    }
}


def states() -> np.ndarray:
    """Time, then qpos (2 arm, 1 finger, 7 cube, 1 door), then 10 speeds."""
    t = np.arange(COUNT) / 20.0
    quaternions = np.column_stack([np.cos(t), np.zeros((COUNT, 2)), np.sin(t)])
    cube = np.column_stack([0.1 * t, np.zeros(COUNT), np.full(COUNT, 0.5), quaternions])
    qpos = np.column_stack([t, -0.5 * t, 0.02 * t, cube, 0.3 * t])
    return np.column_stack([7.0 + t, qpos, np.zeros((COUNT, 10))])


def actions() -> np.ndarray:
    return np.column_stack([np.full((COUNT, 6), 0.5), np.where(np.arange(COUNT) < 12, -1.0, 1.0)])


def written(tmp_path, demos=("demo_10", "demo_2"), arguments=OSC, model=MODEL, **values):
    file = tmp_path / "low_dim.hdf5"
    with h5py.File(file, "w") as out:
        out.create_group("data").attrs["env_args"] = json.dumps(arguments)
        for name in demos:
            group = out["data"].create_group(name)
            group.attrs["model_file"] = model
            for key, value in {"states": states(), "actions": actions(), **values}.items():
                if value is not None:
                    group[key] = value
    return file


def test_states_are_played_by_the_kinematics_of_their_model(tmp_path):
    found = recording_from_hdf5(written(tmp_path))
    model = mujoco.MjModel.from_xml_string(
        MODEL.replace('<mesh name="link" file="gone.stl"/>', "").replace('type="mesh" mesh="link"', 'size="0.01"')
    )
    data = mujoco.MjData(model)
    for k, row in enumerate(states()):
        data.qpos[:] = row[1:12]
        mujoco.mj_forward(model, data)
        np.testing.assert_allclose(found.hand[k].position, data.site("gripper0_grip_site").xpos, atol=1e-12)
        np.testing.assert_allclose(found.hand[k].rotation.ravel(), data.site("gripper0_grip_site").xmat, atol=1e-9)
        np.testing.assert_allclose(found.objects["cube"][k].position, data.body("cube_main").xpos, atol=1e-12)
    np.testing.assert_allclose(found.joints, states()[:, 1:3])
    assert set(found.other_joints) == {"gripper0_finger_joint1", "hinge"}
    np.testing.assert_allclose(found.other_joints["hinge"], states()[:, 11])
    assert set(found.fixtures) == {"table"}
    np.testing.assert_allclose(found.fixtures["table"].vector, [0, 0, 0.4, 1, 0, 0, 0])
    np.testing.assert_allclose(found.time, np.arange(COUNT) / 20.0)
    np.testing.assert_array_equal(found.gripper, actions()[:, 6])
    np.testing.assert_allclose(found.commanded.positions - found.hand.positions, 0.05, atol=1e-12)
    assert "episode demo_2 of 2 episodes" in found.notes


@pytest.mark.parametrize(
    "arguments",
    [
        {},
        {"env_kwargs": {"controller_configs": {"type": "JOINT_VELOCITY"}}},
        {"env_kwargs": {"controller_configs": {"type": "OSC_POSE", "control_delta": False}}},
        {"env_kwargs": {"controller_configs": {"type": "OSC_POSE", "input_type": "absolute"}}},
    ],
)
def test_actions_of_another_controller_are_no_commanded_path(arguments, tmp_path):
    found = recording_from_hdf5(written(tmp_path, arguments=arguments), "demo_10")
    assert found.commanded is None
    assert any("only the last is read" in note for note in found.notes)


@pytest.mark.parametrize(
    "values, message",
    [
        ({"states": states()[:, :-1]}, r"data/demo_2/states: has 21 columns; the model needs 22"),
        ({"states": states()[:-1]}, r"data/demo_2/states: are 19, actions 20"),
        (
            {"states": np.where(np.eye(COUNT, 22) > 0, np.nan, states())},
            r"data/demo_2/states: is not finite at index 0",
        ),
        ({"states": None}, r"data/demo_2/states: is missing; there are: actions"),
        ({"actions": np.zeros(COUNT)}, r"data/demo_2/actions: is float64 of shape \(20,\)"),
        ({"model": "<mujoco><worldbody>"}, "model_file: is no XML"),
        ({"model": "<mujoco><worldbody/></mujoco>"}, "has 22 columns; the model needs 1"),
        ({"model": "<!DOCTYPE lolz>" + MODEL}, "too large, or no plain MJCF"),
        (
            {"model": MODEL.replace("grip_site", "center")},
            "has 0 sites grip_site: name the tcp with --hand",
        ),
        ({"demos": ()}, "data: is missing or empty"),
    ],
)
def test_bad_files_are_refused_in_one_line(values, message, tmp_path):
    file = written(tmp_path, **values)
    with pytest.raises(BadDemonstration, match=message) as caught:
        recording_from_hdf5(file)
    assert str(caught.value).startswith(str(file)) and "\n" not in str(caught.value)


def test_unknown_names_and_other_files_are_refused(tmp_path):
    file = written(tmp_path)
    with pytest.raises(UnknownName, match="unknown episode 'demo_3'; known: demo_2, demo_10"):
        recording_from_hdf5(file, "demo_3")
    with pytest.raises(UnknownName, match="unknown site of the tcp 'tip'; known: gripper0_grip_site"):
        recording_from_hdf5(file, hand="tip")
    (tmp_path / "no.hdf5").write_bytes(b"nothing of the kind")
    for bad in (tmp_path / "no.hdf5", tmp_path / "missing.hdf5", tmp_path):
        with pytest.raises(OneDemoError) as caught:
            recording_from_hdf5(bad)
        assert "\n" not in str(caught.value)
