"""Corrections of skills in files beside demonstrations, and on the command line."""

from __future__ import annotations

import shutil

import pytest

from onedemo.configs import BadConfig, load_demonstration
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.configs.skill_file import as_mapping, read_corrections, skill_file, with_said, write_corrections
from onedemo.planner.imitation.corrections import Corrections, PhaseCorrection

SAID = ["carry nut (2): reference=peg1", "carry nut (2): turns=false", "reach nut: grasp=162", "cubeA=red cube"]


def test_what_is_said_is_read_as_it_was_written(tmp_path):
    corrections, file = with_said(Corrections(), SAID), tmp_path / "mine.skill.yaml"
    assert corrections.phases == {
        "carry nut (2)": PhaseCorrection(reference="peg1", turns=False),
        "reach nut": PhaseCorrection(grasp=162),
    }
    assert corrections.names == {"cubeA": "red cube"}
    write_corrections(corrections, file)
    read = read_corrections(file)
    assert (read.names, read.phases, read.source) == (corrections.names, corrections.phases, str(file))


def test_more_is_added_to_what_was_said():
    once = with_said(Corrections(), SAID)
    twice = with_said(once, ["carry nut (2): turns=true", "carry nut (2): goal=rest"])
    assert twice.of("carry nut (2)") == PhaseCorrection(reference="peg1", turns=True, goal="rest")
    assert twice.of("reach nut") == once.of("reach nut")
    assert as_mapping(Corrections()) == {}


def test_a_demonstration_has_what_is_said_beside_it(tmp_path):
    file = tmp_path / "mine.npz"
    shutil.copy(shipped_demonstration("stack"), file)
    assert load_demonstration(file).corrections == Corrections()
    write_corrections(with_said(Corrections(), ["carry cubeA: turns=false"]), skill_file(file))
    assert load_demonstration(file).corrections.of("carry cubeA").turns is False
    write_corrections(with_said(Corrections(), ["carry cubeA: goal=rest"]), skill_file(file))
    assert load_demonstration(file).corrections.of("carry cubeA") == PhaseCorrection(goal="rest")
    skill_file(file).unlink()
    assert load_demonstration(file).corrections == Corrections()


@pytest.mark.parametrize(
    "text, words",
    [
        ("phases: [1]", "phases: does not hold `name: …` lines"),
        ("phases: {carry nut: rest}", "phases.carry nut: does not hold `key: value` lines"),
        ("phases: {carry nut: {refrence: peg}}", "phases.carry nut.refrence: unknown key; did you mean 'reference'?"),
        ("phases: {carry nut: {goal: there}}", "phases.carry nut.goal: input should be 'release' or 'rest'"),
        ("phases: {reach nut: {grasp: 1.5}}", "phases.reach nut.grasp: "),
        ("names: {cubeA: 3}", "names.cubeA: is not the name of a thing in the task, got 3"),
        ("phase: {}", "phase: unknown key; did you mean 'phases'?"),
        ("source: me", "source: unknown key; allowed: names, phases"),
    ],
)
def test_what_a_file_says_wrongly_is_named(text, words, tmp_path):
    file = tmp_path / "mine.skill.yaml"
    file.write_text(text)
    with pytest.raises(BadConfig) as refused:
        read_corrections(file)
    assert str(refused.value).startswith(f"{file}: {words}")


@pytest.mark.parametrize("text", ["carry nut", "carry nut: reference", "carry nut: =peg", "=red", "cubeA=", ""])
def test_another_form_is_refused(text):
    with pytest.raises(BadConfig, match="is not of the form 'PHASE: KEY=VALUE' or 'NAME=NAME IN THE TASK'"):
        with_said(Corrections(), [text])
