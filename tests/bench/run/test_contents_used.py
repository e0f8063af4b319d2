"""A file of one's own decides what a run is: when its content has changed, it is another run."""

from __future__ import annotations

import shutil

import numpy as np
import pytest

from onedemo.bench.run.contents_used import with_contents
from onedemo.configs import BadConfig
from onedemo.configs.grid import load_grid
from onedemo.configs.shipped_files import shipped_demonstration

TEXT = "{{name: own, task: stack, demonstration: {}, method: '{}', episodes: 2{}}}"


def grid_in(folder, demonstration="mine.npz", method="screw", more=""):
    file = folder / "own.yaml"
    file.write_text(TEXT.format(demonstration, method, more))
    return load_grid(file)


@pytest.fixture
def mine(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    shutil.copy(shipped_demonstration("stack"), "mine.npz")
    return tmp_path


def digest(folder, **options):
    return with_contents(grid_in(folder, **options)).digest()


def test_another_demonstration_under_the_same_name_is_another_run(mine):
    before = digest(mine)
    assert digest(mine) == before
    arrays = dict(np.load("mine.npz"))
    np.savez("mine.npz", **{**arrays, "licence": np.array("mine")})
    assert digest(mine) != before


def test_what_is_said_of_its_skill_makes_another_run(mine):
    before = digest(mine)
    (mine / "mine.skill.yaml").write_text("phases: {carry cubeA: {goal: rest}}")
    assert digest(mine) != before
    (mine / "mine.skill.yaml").unlink()
    assert digest(mine) == before


def test_a_module_that_has_changed_makes_another_run(mine):
    (mine / "own_policy_here.py").write_text("Mine = 1")
    before = digest(mine, method="own_policy_here:Mine")
    (mine / "own_policy_here.py").write_text("Mine = 22")
    assert digest(mine, method="own_policy_here:Mine") != before


def test_a_module_that_is_not_there_is_left_to_whoever_imports_it(mine):
    assert (
        digest(mine, demonstration="stack", method="no_such.module:Mine")
        == grid_in(mine, "stack", "no_such.module:Mine").digest()
    )


def test_runs_with_shipped_files_keep_their_names(mine):
    grid = grid_in(mine, demonstration="stack")
    assert with_contents(grid).digest() == grid.digest()
    assert "contents" not in grid.cells[0].model_dump(mode="json")


def test_only_the_content_that_was_written_down_is_run(mine):
    (cell,) = with_contents(grid_in(mine)).cells
    same = with_contents(grid_in(mine, more=f", contents: '{cell.contents}'"))
    assert same.cells == (cell,)
    with pytest.raises(BadConfig, match=r"contents: 0{12} is wanted; the files have [0-9a-f]{12} \(.*mine.npz\)"):
        with_contents(grid_in(mine, more=", contents: '000000000000'"))
    with pytest.raises(BadConfig, match=r"the files have None \(no file of one's own is used\)"):
        with_contents(grid_in(mine, demonstration="stack", more=", contents: '000000000000'"))
