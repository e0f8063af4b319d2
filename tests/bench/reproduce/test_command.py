"""`onedemo reproduce`: every experiment can be begun, what is finished is kept, and the page says what was measured."""

from __future__ import annotations

import base64
import csv
import json
from dataclasses import replace
from pathlib import Path

import matplotlib.image
import numpy as np
import pytest
from helpers.pages import Page, needs_browser, needs_nothing_else, same_numbers, screenshot

from onedemo.bench.drawing.surfaces import surface
from onedemo.bench.reproduce import command
from onedemo.bench.reproduce.command import changes, draw_trees, finished, reproduce, run_folder_of
from onedemo.bench.reproduce.experiments import EXPERIMENTS, Drawing, Experiment, experiments_named
from onedemo.bench.reproduce.report import (
    HTML,
    LEVEL_MS,
    PAGE,
    results_table,
    run_agrees,
    trees_agree,
    write_page,
)
from onedemo.bench.run.config_checks import check_grid
from onedemo.bench.run.episode_jobs import draw, made
from onedemo.configs.grid import load_grid
from onedemo.configs.plan_scene import load_scene, shipped_scene
from onedemo.configs.shipped_files import shipped_config
from onedemo.planner.errors import UnknownName
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Capsule, Cylinder, Sphere

RUNS = [each for each in EXPERIMENTS if isinstance(each, Experiment)]
(TREE,) = (each for each in EXPERIMENTS if isinstance(each, Drawing))
ROW = {
    "successes": 9, "episodes": 10, "safe_successes": 9, "wilson_low": 0.6, "wilson_high": 0.98, "touching": 0,
    "clearance_mm_min": 12.34, "failures": {"blocked": 1}, "error": "largest position error [mm]", "error_max": 2.0,
}  # fmt: skip


TIMES = {"tick_us_median": 50.0, "tick_us_p99": 90.0, "tick_us_max": 9e4, "seconds_median": 7.0, "seconds_max": 8.0}
TIMES_OF_A_TREE = {
    "planes": 4, "levels": 3, "plane_ms": (0.1, 0.0), "detour_ms": (0.2, 0.1), "detour_level_ms": (0.3, 0.1),
    "plan_ms": 9.0, "judged": True,
}  # fmt: skip


def cell_of(experiment):
    grid = load_grid(shipped_config(experiment.config), changes(experiment, None, video=False))
    check_grid(grid)
    (cell,) = grid.cells
    return cell


@pytest.mark.parametrize("experiment", RUNS, ids=lambda each: each.name)
def test_every_experiment_can_be_begun(experiment):
    cell = cell_of(experiment)
    assert (cell.name, cell.episodes) == (experiment.name, experiment.episodes)
    env = made(cell)
    try:
        obstacles = draw(env, cell, 0)["start"]["obstacles"]
    finally:
        env.close()
    # what the paper speaks of is there: how many at least and at most, and which of them move or appear later
    least, most = {"pour_obstacles": (1, 3), "stack": (1, 1), "shelve_one": (1, 1), "shelve_two": (2, 2)}.get(
        experiment.name, (0, 0)
    )
    assert least <= len(obstacles) <= most
    assert [bool(each["frequency"]) for each in obstacles] == [experiment.name == "stack"] * len(obstacles)
    if experiment.config == "shelve":
        assert all(each["motion"] > 0 for each in obstacles)


def test_names_differ_and_pick_in_order():
    names = [each.name for each in EXPERIMENTS]
    assert len(set(names)) == len(names)
    assert [each.name for each in experiments_named(["tree", "stack"])] == ["stack", "tree"]
    assert experiments_named([]) == list(EXPERIMENTS)


def test_an_unknown_name_is_one_line_with_the_known_ones(tmp_path):
    with pytest.raises(UnknownName) as error:
        reproduce(["juggle"], tmp_path / "none")
    text = str(error.value)
    assert "\n" not in text
    for each in EXPERIMENTS:
        assert each.name in text
    assert not (tmp_path / "none").exists()


def test_video_and_folder_are_no_part_of_what_is_run():
    each = RUNS[0]
    assert run_folder_of(each, Path("a"), None).name == run_folder_of(each, Path("b"), None).name
    assert run_folder_of(each, Path("a"), 3).name != run_folder_of(each, Path("a"), None).name


def test_scenes_of_drawings_are_shipped():
    for scene in TREE.scenes:
        load_scene(shipped_scene(scene))


def test_one_experiment_and_a_tree_end_to_end_and_again(tmp_path, monkeypatch, capsys):
    """A seed of the quickest experiment and two samples of one tree; the second time nothing is run or drawn."""
    quick = replace(next(each for each in RUNS if each.name == "bimanual"), episodes=1)
    few = replace(TREE, scenes=("sphere",), repeats=2)
    monkeypatch.setattr("onedemo.bench.reproduce.experiments.EXPERIMENTS", (quick, few))
    monkeypatch.setattr(command, "EXPERIMENTS", (quick, few))
    assert reproduce([], tmp_path, video=False) == 0
    assert capsys.readouterr().out.splitlines()[-2:] == [str(tmp_path / PAGE), str(tmp_path / HTML)]
    text = (tmp_path / PAGE).read_text()
    page = Page((tmp_path / HTML).read_text(encoding="utf-8"))
    assert needs_nothing_else(page, tmp_path, "png")
    assert [each["src"] for tag, each in page.tags if tag == "img"] == [
        f"data:image/png;base64,{base64.b64encode((tmp_path / picture).read_bytes()).decode()}"
        for picture in ("figures/bimanual.png", "figures/tree_sphere.png")
    ]
    assert same_numbers(page, text)
    assert "| From one arm to two | 1 of 1 |" in text or "| From one arm to two | 0 of 1 |" in text
    for picture in ("figures/bimanual.png", "figures/tree_sphere.png"):
        assert f"]({picture})" in text
        assert matplotlib.image.imread(tmp_path / picture)[..., :3].std() > 0.02
        assert (tmp_path / picture).with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert not (tmp_path / "videos" / "bimanual.mp4").exists()
    (times,) = csv.DictReader((tmp_path / "times.csv").open())
    assert float(times["motion_s_median"]) > 1.0 > 1e-6 * float(times["tick_us_median"]) > 0.0
    (tree,) = csv.DictReader((tmp_path / "trees.csv").open())
    assert float(tree["detour_ms"]) > float(tree["plane_ms"]) > 0.0
    kept = {path: path.stat().st_mtime_ns for path in tmp_path.glob("runs/*/episodes.jsonl")}
    kept |= {tmp_path / "trees.json": (tmp_path / "trees.json").stat().st_mtime_ns}
    monkeypatch.setattr("onedemo.bench.run.command.executor_for", _no_jobs)
    monkeypatch.setattr(command, "_drawn", _nothing)
    assert reproduce([], tmp_path, video=False) == 0
    assert len(kept) == 2
    assert kept == {path: path.stat().st_mtime_ns for path in kept}
    assert (tmp_path / PAGE).read_text().split("Made on")[0] == text.split("Made on")[0]


class _no_jobs:
    """An executor that must not be asked for anything."""

    def __init__(self, *_):
        pass

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def results(self, jobs):
        raise AssertionError(f"{jobs} would be run again")


def _nothing(*_):
    raise AssertionError("drawn again")


def test_trees_are_drawn_anew_when_a_picture_is_gone(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr(
        command, "_drawn", lambda scene, picture, repeats: drawn.append(picture.touch()) or {"s": scene}
    )
    (tmp_path / "figures").mkdir()
    few = replace(TREE, scenes=("sphere", "shelf"))
    draw_trees(few, tmp_path)
    draw_trees(few, tmp_path)
    assert len(drawn) == 2
    (tmp_path / "figures" / "tree_shelf.png").unlink()
    draw_trees(few, tmp_path)
    draw_trees(replace(few, repeats=few.repeats + 1), tmp_path)
    assert len(drawn) == 6
    assert [row["s"] for row in json.loads((tmp_path / "trees.json").read_text())["rows"]] == ["sphere", "shelf"]


def test_what_has_not_been_run_is_not_reported(tmp_path):
    assert [finished(each, tmp_path, None) for each in EXPERIMENTS] == [None] * len(EXPERIMENTS)


@pytest.mark.parametrize(
    "changed, said",
    [
        (
            {},
            "Agrees in 9 of 10 starts, the others failed (blocked 1); no obstacle was touched, the nearest was 12.3 mm",
        ),
        ({"successes": 10, "failures": {}}, "Agrees: done from one demonstration in all 10 starts; no obstacle"),
        ({"successes": 0, "failures": {"dropped": 10}}, "Does not agree: none of 10 starts succeeded (dropped 10)"),
        ({"touching": 2}, "an obstacle was touched in 2 of 10"),
        ({"clearance_mm_min": None}, "(blocked 1)."),
    ],
)
def test_the_sentence_says_what_the_numbers_say(changed, said):
    assert said in run_agrees({**ROW, **changed})


def test_the_sentence_about_trees_compares_with_what_the_paper_prints():
    row = {"judged": True, "plane_ms": (2 * LEVEL_MS, 0.0), "detour_level_ms": (0.5, 0.1)}
    assert "2.00 to 2.00 of the 0.0429" in trees_agree([row])
    assert trees_agree([row]).startswith("Agrees: ")
    assert trees_agree([row, {**row, "judged": False}]).startswith("Agrees in 1 of 2 scenes")


def test_the_table_tells_touching_from_nothing_to_touch():
    done = command.Finished(RUNS[0], [ROW], (), "")
    assert results_table([done]).rows[0][4:] == ["0 of 10", "12.3", "2.0 mm (position)"]
    free = command.Finished(RUNS[0], [{**ROW, "clearance_mm_min": None}], (), "")
    assert results_table([free]).rows[0][4:6] == ["-", "-"]


@needs_browser
@pytest.mark.parametrize("width, height", [(390, 844), (1280, 900)])
def test_the_page_is_drawn_on_a_phone_and_on_a_desk(tmp_path, width, height):
    (tmp_path / "figures").mkdir()
    matplotlib.image.imsave(tmp_path / "figures" / "pour.png", np.full((300, 400, 3), (0, 96, 168), dtype=np.uint8))
    _, page = write_page(tmp_path, [command.Finished(RUNS[0], [ROW | TIMES], ("figures/pour.png",), "")], "no time")
    pixels = screenshot(page, tmp_path, width, height)
    assert pixels.shape == (height, width, 3)
    blue = (np.abs(pixels - (0, 96, 168)) < 8).all(axis=2)
    assert blue.mean() > 0.02, "the figure"
    assert (pixels.min(axis=2) < 100).mean() > 0.005, "letters"
    assert (pixels[:, :8] > 240).all(), "a margin"


def test_the_page_is_made_of_what_is_there(tmp_path):
    """A picture that was taken away is left out; what others have written stays words."""
    (tmp_path / "figures").mkdir()
    (tmp_path / "trees.json").write_text(json.dumps({"rows": [TIMES_OF_A_TREE | {"scene": "<b>x</b> | y"}]}))
    done = finished(TREE, tmp_path, None)
    assert done.pictures == ()
    pages = write_page(tmp_path, [command.Finished(RUNS[0], [ROW | TIMES], (), "videos/pour.mp4"), done], "no time")
    text, page = pages[0].read_text(encoding="utf-8"), Page(pages[1].read_text(encoding="utf-8"))
    assert not {"b", "img"} & {tag for tag, _ in page.tags}
    assert ("a", {"href": "videos/pour.mp4"}) in page.tags and "](videos/pour.mp4)" in text
    assert "<b>x</b> | y" in page.words and "<b>x" not in text
    assert "onedemo run pour level=L2 obstacles=none" in page.words


@pytest.mark.parametrize("shape", [Box((0.1, 0.2, 0.3)), Sphere(0.1), Capsule(0.05, 0.2), Cylinder(0.1, 0.3)], ids=repr)
def test_surfaces_lie_on_the_shape(shape):
    pose = Pose.from_yaw([1.0, 2.0, 3.0], 0.4)
    points = np.vstack(surface(shape, pose))
    x, y, z = ((points - pose.position) @ pose.rotation).T
    if isinstance(shape, Box):
        off = np.abs(np.abs(np.stack([x, y, z])) - 0.5 * np.array(shape.size)[:, None]).max()
    elif isinstance(shape, Cylinder):
        off = np.abs(np.abs(z) - 0.5 * shape.length).max()
        assert np.hypot(x, y).max() == pytest.approx(shape.radius)
    else:
        half = 0.5 * shape.length if isinstance(shape, Capsule) else 0.0
        off = np.abs(np.hypot(np.hypot(x, y), np.maximum(np.abs(z) - half, 0.0)) - shape.radius).max()
    assert off < 1e-12
