"""`onedemo demo skill`, as users type it."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from onedemo.bench.recordings.skill_figure import spans_of
from onedemo.configs import load_demonstration
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.skills.infer import infer_skill

from .test_import_command import called


@pytest.fixture
def nuts(tmp_path):
    shutil.copy(shipped_demonstration("nut_assembly"), tmp_path / "nuts.npz")
    return tmp_path / "nuts.npz"


def test_what_is_kept_is_there_the_next_time(nuts, monkeypatch, capsys):
    code, out, _ = called(monkeypatch, capsys, "demo", "skill", nuts, "--set", "carry RoundNut0: goal=rest")
    assert code == 0 and "goal as said" in out and "not kept: --save" in out
    assert "as said" not in called(monkeypatch, capsys, "demo", "skill", nuts)[1]
    code, out, _ = called(monkeypatch, capsys, "demo", "skill", nuts, "--set", "carry RoundNut0: goal=rest", "--save")
    assert code == 0 and f"wrote {nuts.with_suffix('.skill.yaml')}" in out
    for command in ("skill", "check"):
        assert "goal as said" in called(monkeypatch, capsys, "demo", command, nuts)[1]
    called(monkeypatch, capsys, "demo", "skill", nuts, "--set", "reach RoundNut0: turns=false", "--save")
    out = called(monkeypatch, capsys, "demo", "skill", nuts)[1]
    assert "goal as said" in out and "turns as said" in out


@pytest.mark.parametrize("suffix", [".png", ".svg"])
def test_the_picture_names_every_phase(suffix, nuts, monkeypatch, capsys):
    picture = nuts.with_name(f"skill{suffix}")
    assert called(monkeypatch, capsys, "demo", "skill", nuts, "--picture", picture)[0] == 0
    assert picture.stat().st_size > 10_000


@pytest.mark.parametrize(
    "options, words",
    [
        (["--set", "carry X: goal=rest"], "unknown phase 'carry X'; known: reach RoundNut0, carry RoundNut0"),
        (["--set", "carry RoundNut0"], "is not of the form 'PHASE: KEY=VALUE'"),
        (["--picture", "skill.jpg"], "--picture: skill.jpg does not end in .png, .pdf, .svg"),
    ],
)
def test_what_is_wrong_is_one_line(options, words, nuts, monkeypatch, capsys):
    code, _, error = called(monkeypatch, capsys, "demo", "skill", nuts, *options)
    assert code == 2 and words in error and error.count("\n") == 1


def test_phases_follow_one_another_in_the_picture():
    demonstration = load_demonstration("nut_assembly")
    skill = infer_skill(demonstration)
    spans = spans_of(demonstration, skill)
    assert [span.name for span in spans] == [phase.name for phase in skill.phases]
    edges = np.array([(span.start, span.stop) for span in spans])
    assert (edges[:, 0] < edges[:, 1]).all() and (edges[1:, 0] >= edges[:-1, 1]).all()
