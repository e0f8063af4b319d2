"""Ray's actors as workers: the same table, and the same faults survived."""

from __future__ import annotations

import json
import socket
import sys
import types
from pathlib import Path

import pytest
from helpers.fake_runs import ONE_CELL, completed, dispatcher, grid_in
from helpers.fake_worker import FakeJobs

from onedemo.bench.episodes.run_folder import table_hash
from onedemo.bench.run.episode_jobs import EpisodeJobs
from onedemo.bench.workers.dispatcher import HUNG, Dispatcher
from onedemo.bench.workers.executors import executor_for
from onedemo.bench.workers.ray_actors import PATIENCE, RayActors, check_reachable
from onedemo.configs.errors import BadConfig
from onedemo.configs.run_config import RunSettings


@pytest.fixture
def ray():
    return pytest.importorskip("ray", reason="needs the extra: pip install 'onedemo[ray]'")


def test_without_ray_it_is_said_what_to_install(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", None)
    with pytest.raises(BadConfig, match=r"Ray: executor: is not installed: pip install 'onedemo\[ray\]'"):
        executor_for(RunSettings(executor="ray"), EpisodeJobs, 10, tmp_path / "log")


class NoRay(types.ModuleType):
    """Ray's module without Ray: it must not be asked for what is not there."""

    def init(self, **options):
        raise AssertionError("Ray would wait")


@pytest.fixture
def port():
    """Of nobody: it was free a moment ago."""
    with socket.create_server(("127.0.0.1", 0)) as server:
        return server.getsockname()[1]


@pytest.mark.parametrize("form", ["ray://127.0.0.1:{}", "127.0.0.1:{}", "ray://localhost:{}"])
def test_a_cluster_that_is_not_there_is_said_at_once(form, port, monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", NoRay("ray"))
    address = form.format(port)
    with pytest.raises(BadConfig) as caught:
        executor_for(RunSettings(executor="ray", address=address), EpisodeJobs, 10, tmp_path / "log")
    assert str(caught.value) == f"Ray: address: no cluster at {address}: Connection refused"


def test_a_machine_that_does_not_answer_is_not_waited_for(monkeypatch):
    """A silent one, and a name that nobody has."""

    def silent(address, seconds):
        assert (address, seconds) == (("10.0.0.1", 10001), PATIENCE)
        raise TimeoutError("timed out")

    with monkeypatch.context() as patched:
        patched.setattr(socket, "create_connection", silent)
        with pytest.raises(BadConfig, match=r"no cluster at ray://10\.0\.0\.1:10001: timed out"):
            check_reachable("ray://10.0.0.1:10001")
    for name in ("no-such-machine.invalid", "x" * 300):
        with pytest.raises(BadConfig, match=f"no cluster at ray://{name}:1: ") as caught:
            check_reachable(f"ray://{name}:1")
        assert "\n" not in str(caught.value)


def test_who_answers_is_left_to_ray(monkeypatch, tmp_path):
    monkeypatch.setitem(sys.modules, "ray", NoRay("ray"))
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"ray://127.0.0.1:{server.getsockname()[1]}"
        for asked in (address, "auto"):
            with pytest.raises(AssertionError, match="Ray would wait"):
                executor_for(RunSettings(executor="ray", address=asked), EpisodeJobs, 10, tmp_path / "log")


@pytest.mark.parametrize(
    "address", ["ray://host", "host", "ray://host:0", "ray://host:70000", "http://host:1", "", ":1"]
)
def test_what_is_no_address_is_refused_in_one_line(address):
    with pytest.raises(BadConfig, match=r"is not ray://HOST:PORT, HOST:PORT, auto or local"):
        check_reachable(address)


def test_an_address_of_the_sixth_version_has_brackets(monkeypatch):
    asked = []
    monkeypatch.setattr(socket, "create_connection", lambda address, seconds: asked.append(address) or FakeSocket())
    check_reachable("ray://[::1]:10001")
    assert asked == [("::1", 10001)]


class FakeSocket:
    def close(self):
        pass


def test_two_actors_make_the_same_table_and_survive_a_death_and_a_hang(ray, monkeypatch, tmp_path):
    grid = grid_in(tmp_path, ONE_CELL)
    reference = completed(grid, tmp_path / "processes", dispatcher())
    (tmp_path / "marks").mkdir()
    faults = {"2": ["die", 1], "5": ["stop", 1], "8": ["endless", 2]}
    monkeypatch.setenv("PYTHONPATH", str(Path(__file__).parents[2]))
    monkeypatch.setenv("FAKE", json.dumps({"marks": str(tmp_path / "marks"), "faults": faults}))
    executor = Dispatcher(RayActors(None, 2, FakeJobs, tmp_path / "log"), 2, 5.0)
    assert ray.is_initialized()
    records = completed(grid, tmp_path / "run", executor)
    assert not ray.is_initialized()
    (lost,) = [key for key, record in records.items() if record.failure_reason]
    assert (lost[1], records[lost].failure_reason) == (8, HUNG)
    del records[lost], reference[lost]
    assert table_hash(records.values()) == table_hash(reference.values())
    assert len(list((tmp_path / "marks").iterdir())) == 4
