"""Ray's actors as workers: the same table, and the same faults survived."""

from __future__ import annotations

import json
import sys
from pathlib import Path

import pytest
from fake_runs import ONE_CELL, completed, dispatcher, grid_in
from fake_worker import FakeBench

from onedemo.bench.dispatch import Dispatcher
from onedemo.bench.executors import executor_for
from onedemo.bench.ray_actors import RayActors
from onedemo.bench.records import HUNG
from onedemo.bench.run_folder import table_hash
from onedemo.configs.cell import RunSettings
from onedemo.planner.errors import BadConfig


@pytest.fixture
def ray():
    return pytest.importorskip("ray", reason="needs the extra: pip install 'onedemo[ray]'")


def test_without_ray_it_is_said_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(BadConfig, match=r"Ray: executor: is not installed: pip install 'onedemo\[ray\]'"):
        executor_for(RunSettings(executor="ray"), 10, tmp_path / "log")


def test_two_actors_make_the_same_table_and_survive_a_death_and_a_hang(ray, monkeypatch, tmp_path):
    grid = grid_in(tmp_path, ONE_CELL)
    reference = completed(grid, tmp_path / "processes", dispatcher())
    (tmp_path / "marks").mkdir()
    faults = {"2": ["die", 1], "5": ["stop", 1], "8": ["endless", 2]}
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[1]))
    monkeypatch.setenv("FAKE", json.dumps({"marks": str(tmp_path / "marks"), "faults": faults}))
    executor = Dispatcher(RayActors(None, 2, tmp_path / "log", FakeBench), 2, 5.0)
    assert ray.is_initialized()
    records = completed(grid, tmp_path / "run", executor)
    assert not ray.is_initialized()
    (lost,) = [key for key, record in records.items() if record.failure_reason]
    assert (lost[1], records[lost].failure_reason) == (8, HUNG)
    del records[lost], reference[lost]
    assert table_hash(records.values()) == table_hash(reference.values())
    assert len(list((tmp_path / "marks").iterdir())) == 4
