"""`onedemo curves`: the numbers of trainings in one figure and one table, beside what needs no step."""

from __future__ import annotations

import csv
import json
import re
import shutil
from dataclasses import asdict

import pytest
from helpers.example_runs import small_run

from onedemo.bench.curves.command import run_curves
from onedemo.bench.method_table import look_of, other_look
from onedemo.bench.train.evaluations import LEG, NUMBERS, Point
from onedemo.configs.errors import BadConfig
from onedemo.configs.train_config import TrainConfig

EPISODES = 10


def training(folder, algorithm="sac", shares=((0.0, 0.5), (0.0, 1.0)), task="stack", **changes):
    """A folder as `onedemo train` leaves it: for each seed the shares of successes, one after the other."""
    config = TrainConfig(
        name=algorithm, task=task, algorithm=algorithm, demonstration="stack", steps=2000, seeds=len(shares), **changes
    )
    folder.mkdir(parents=True)
    (folder / "config.json").write_text(json.dumps(config.model_dump(mode="json")))
    for seed, found in enumerate(shares):
        points = []
        for leg, share in enumerate(found, 1):
            successes = tuple(k < share * EPISODES for k in range(EPISODES))
            points.append(Point(seed, leg, 1000 * leg, successes, tuple(100.0 * share for _ in successes), 60.0 * leg))
        leg = folder / f"seed-{seed}" / LEG.format(len(points))
        leg.mkdir(parents=True)
        (leg / NUMBERS).write_text(json.dumps({"digest": "", "points": [asdict(point) for point in points]}))
    return folder


def rows_of(folder):
    (file,) = folder.glob("*.csv")
    return list(csv.DictReader(file.open()))


def test_numbers_are_those_of_all_seeds_and_the_table_is_their_end(tmp_path, capsys):
    run_curves([training(tmp_path / "a")], None, tmp_path / "out")
    first, last = rows_of(tmp_path / "out")
    assert (first["method"], first["steps"], first["seeds"], float(first["success"])) == ("sac", "1000", "2", 0.0)
    assert float(last["success"]) == 0.75 and float(last["low"]) < 0.75 < float(last["high"])
    page = (tmp_path / "out" / "curves-stack-panda.md").read_text()
    assert "| sac | 2 000 | 2 | 75% of 20 |" in page and "(curves-stack-panda.png)" in page
    written = capsys.readouterr().out.split()
    assert written[-1].endswith("curves-stack-panda.md")
    for suffix in (".png", ".pdf"):
        assert (tmp_path / "out" / f"curves-stack-panda{suffix}").stat().st_size > 1000


def test_it_goes_as_far_as_all_seeds_have_come(tmp_path):
    run_curves([training(tmp_path / "a", shares=((0.0, 0.5, 1.0), (0.3,)))], None, tmp_path / "out")
    (row,) = rows_of(tmp_path / "out")
    assert row["steps"] == "1000" and float(row["success"]) == pytest.approx(0.15)


def test_trainings_by_one_algorithm_are_told_apart(tmp_path):
    folders = [training(tmp_path / "a"), training(tmp_path / "b", learner={"gamma": 0.9})]
    run_curves(folders, None, tmp_path / "out")
    names = {row["method"] for row in rows_of(tmp_path / "out")}
    assert names == {"sac, gamma 0.95", "sac, gamma 0.9"}
    assert other_look("sac", 0) == look_of("sac")
    assert len({(look.color, look.marker) for look in (other_look("sac", k) for k in range(6))}) == 6


def test_the_same_training_elsewhere_is_named_by_its_folder_and_drawn_once(tmp_path):
    folders = [training(tmp_path / "a"), training(tmp_path / "b")]
    run_curves([*folders, folders[0]], None, tmp_path / "out")
    assert {row["method"] for row in rows_of(tmp_path / "out")} == {f"sac ({folder})" for folder in folders}


def test_what_has_not_been_evaluated_is_left_out_and_named(tmp_path, capsys):
    begun = training(tmp_path / "begun", "ppo", ((0.0,),))
    shutil.rmtree(begun / "seed-0")
    run_curves([begun, training(tmp_path / "a")], None, tmp_path / "out")
    assert {row["method"] for row in rows_of(tmp_path / "out")} == {"sac"}
    assert "begun: nothing has been evaluated yet" in capsys.readouterr().err
    with pytest.raises(BadConfig, match="begun: nothing has been evaluated yet"):
        run_curves([begun], None, tmp_path / "out")


def test_a_file_is_no_folder_to_write_to(tmp_path):
    (tmp_path / "out").write_text("mine")
    with pytest.raises(BadConfig, match=r"--output: .*out: is a file, not a folder"):
        run_curves([training(tmp_path / "a")], None, tmp_path / "out")


def test_what_needs_no_step_is_a_line(tmp_path, monkeypatch):
    from onedemo.bench.curves import command as curves_command

    drawn = {}
    monkeypatch.setattr(curves_command, "draw_curves", lambda made, *_: drawn.update(made=made, lines=_[2]) or [])
    run = small_run(tmp_path / "run")
    clone = training(tmp_path / "clone", "bc", ((0.2, 0.4), (0.2, 0.6)))
    run_curves([clone, training(tmp_path / "sac")], run, tmp_path / "out")
    assert list(drawn["made"]) == ["sac"]
    assert set(drawn["lines"]) == {"screw", "replay", "rrt", "bc"}
    assert drawn["lines"]["bc"].share == pytest.approx(0.5)
    page = (tmp_path / "out" / "curves-stack-panda.md").read_text()
    assert "| bc | 0 | 2 | 50% of 20 |" in page and re.search(r"\| screw \| 0 \| +\| \d+% of \d+ \|", page)


@pytest.mark.parametrize(
    "make, message",
    [
        (lambda folder: [folder / "nowhere"], r"nowhere: there is no such folder; give folders that onedemo train"),
        (lambda folder: [small_run(folder / "run")], r"run: has no config\.json; give folders that onedemo train"),
        (
            lambda folder: [training(folder / "a"), training(folder / "b", "ppo", task="reach")],
            r"b/config\.json: task: reach Panda L1 is not stack Panda L1: draw them apart",
        ),
    ],
    ids=["no folder", "a run", "another task"],
)
def test_what_cannot_be_drawn_is_said_in_a_line(make, message, tmp_path):
    with pytest.raises(BadConfig, match=message):
        run_curves(make(tmp_path), None, tmp_path / "out")


def test_a_run_without_the_task_is_refused(tmp_path):
    run = small_run(tmp_path / "run")
    with pytest.raises(
        BadConfig, match=r"--run: .* has no method that needs no training on reach Panda L1; there is .*screw on stack"
    ):
        run_curves([training(tmp_path / "a", task="reach")], run, tmp_path / "out")
