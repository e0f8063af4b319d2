"""Objects of a teleoperation that are none are refused, as those of a table are."""

from __future__ import annotations

import numpy as np
import pytest

from onedemo.configs import load_demonstration

from .test_import_command import called


def teleoperation(file, **more):
    """The shipped stacking in the layout of teleoperations, with some entries more."""
    demo = load_demonstration("stack")
    count = len(demo.time)
    actions = np.zeros((count, 7))
    actions[:, -1] = demo.gripper
    order = [0, 1, 2, 4, 5, 6, 3]
    objects = {f"obj_{name}": path.vectors[:, order] for name, path in demo.object_paths.items()}
    np.savez(file, t=demo.time, q=demo.joint_positions, actions=actions, **objects, **more)
    return file


def beside_the_hand(offset):
    """Poses x y z, then quaternion xyzw, of something fixed to the hand of the shipped stacking."""
    vectors = load_demonstration("stack").path.vectors[:, [0, 1, 2, 4, 5, 6, 3]].copy()
    vectors[:, :3] += offset
    return vectors


def test_a_teleoperation_is_read(tmp_path, monkeypatch, capsys):
    file = teleoperation(tmp_path / "raw.npz")
    assert called(monkeypatch, capsys, "demo", "import", file, "-o", tmp_path / "mine.npz")[0] == 0


@pytest.mark.parametrize("offset", [0.0, 0.010])
def test_another_pose_of_the_hand_is_no_object(offset, tmp_path, monkeypatch, capsys):
    file, out = teleoperation(tmp_path / "raw.npz", obj_target=beside_the_hand(offset)), tmp_path / "mine.npz"
    code, _, error = called(monkeypatch, capsys, "demo", "import", file, "-o", out)
    assert code == 2 and "obj_target" in error and "object 'target' is within 20 mm of the hand" in error
    assert "leave it out with --ignore 'obj_target*'" in error and not out.exists()
    assert called(monkeypatch, capsys, "demo", "import", file, "-o", out, "--ignore", "obj_target*")[0] == 0


def test_an_object_that_was_lost_is_refused(tmp_path, monkeypatch, capsys):
    poses = np.tile([0.5, 0.2, 0.8, 0.0, 0.0, 0.0, 1.0], (len(load_demonstration("stack").time), 1))
    poses[200:230, 0] += 0.4
    file = teleoperation(tmp_path / "raw.npz", obj_tag=poses)
    code, _, error = called(monkeypatch, capsys, "demo", "import", file, "-o", tmp_path / "mine.npz")
    assert code == 2 and "object 'tag' jumps by 0.4 m from sample 199 to 200" in error
    assert error.count("\n") == 1
