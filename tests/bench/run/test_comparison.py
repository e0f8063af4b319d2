"""Real environments: the same bits whoever runs them, on starts that are frozen; what cannot be is refused."""

from __future__ import annotations

import random
import resource
from importlib.util import find_spec
from pathlib import Path

import pytest
from helpers.fake_runs import completed, grid_in

from onedemo.bench.episodes.episode_records import result_of
from onedemo.bench.episodes.run_folder import table_hash
from onedemo.bench.episodes.scenarios import Suite, read_suite
from onedemo.bench.metrics.trace import Trace
from onedemo.bench.run.episode_jobs import EpisodeJobs
from onedemo.bench.workers.dispatcher import ERROR, Dispatcher
from onedemo.bench.workers.executors import Serial, executor_for
from onedemo.bench.workers.processes import Processes, command_of
from onedemo.configs.errors import BadConfig
from onedemo.configs.run_config import RunSettings
from onedemo.planner.errors import OneDemoError

# the time limit keeps it short: none of these succeeds
GRID = """
name: short
demonstration: stack
task: stack
episodes: 2
max_seconds: 3
video: false
sweep: {level: [L1, L4], settings.motion.guide: [0.2, 0.5]}
"""


@pytest.fixture(scope="module")
def serial(tmp_path_factory):
    """A grid, its folder and its records, made in this process."""
    folder = tmp_path_factory.mktemp("serial")
    grid = grid_in(folder, GRID)
    return grid, folder / "run", completed(grid, folder / "run", Serial(EpisodeJobs()))


class Shuffled(Dispatcher):
    """Gives episodes out in another order."""

    def results(self, jobs):
        jobs = list(jobs)
        random.Random(1).shuffle(jobs)
        return super().results(jobs)


@pytest.mark.parametrize("workers", [1, 2])
def test_processes_make_the_same_bits_in_any_order(workers, serial, tmp_path):
    grid, folder, reference = serial
    records = completed(
        grid, tmp_path / "run", Shuffled(Processes(command_of(EpisodeJobs), tmp_path / "log"), workers, 300.0)
    )
    for key, record in reference.items():
        assert result_of(records[key]) == result_of(record)
    assert table_hash(records.values()) == table_hash(reference.values())
    assert (tmp_path / "run" / "scenarios.json").read_bytes() == (folder / "scenarios.json").read_bytes()


@pytest.mark.skipif(find_spec("ray") is None, reason="needs the extra: pip install 'onedemo[ray]'")
def test_ray_makes_the_same_bits(serial, tmp_path):
    grid, _, reference = serial
    executor = executor_for(RunSettings(executor="ray", workers=2), EpisodeJobs, 10, tmp_path / "log")
    assert table_hash(completed(grid, tmp_path / "run", executor).values()) == table_hash(reference.values())


def test_every_record_has_metrics_and_kept_trajectories_change_nothing(serial, tmp_path):
    _, _, reference = serial
    grid = grid_in(tmp_path, GRID.replace("video: false", "trajectories: true\nvideo: false"))
    records = completed(grid, tmp_path / "run", Serial(EpisodeJobs()))
    assert table_hash(records.values()) == table_hash(reference.values())
    for (cell, index), record in records.items():
        assert (record.metrics["clearance"] is None) == (record.clearance is None)
        assert record.metrics["path_length"] > 0.0
        assert len(record.tick_us) == 4
        trace = Trace.load(tmp_path / "run" / "trajectories" / f"{cell}-{index}.npz")
        assert trace.time[-1] == pytest.approx(record.seconds)
        assert len(trace.obstacles) == len(trace.time) == round(record.seconds / trace.dt) + 1
    assert len(list((tmp_path / "run" / "trajectories").iterdir())) == len(records) == 8


def test_methods_see_the_same_scenarios(serial):
    grid, folder, records = serial
    suite = read_suite(folder)
    assert len(suite.scenarios) == 4, "two levels, two episodes; settings share them"
    assert [each["level"] for each in suite.scenarios] == ["L1", "L1", "L4", "L4"]
    a, b = (cell for cell in grid.cells if cell.level == "L4")
    assert [records[a.digest(), k].scenario for k in range(2)] == [records[b.digest(), k].scenario for k in range(2)]
    assert len({record.scenario for record in records.values()}) == 4
    for each in suite.scenarios:
        start = each["start"]
        assert len(start["object_pose"]) == len(start["goal_pose"]) == 3
        assert len(start["joint_positions"][0]) == 7
        assert len(start["obstacles"]) == (each["level"] == "L4")
    obstacle = suite.scenarios[2]["start"]["obstacles"][0]
    assert {"shape", "size", "center", "rotation", "long", "frequency", "motion"} <= set(obstacle)


def test_an_environment_that_draws_something_else_is_found_out(serial, tmp_path):
    grid, folder, _ = serial
    scenarios = [dict(each) for each in read_suite(folder).scenarios]
    poses = [list(pose) for pose in scenarios[1]["start"]["object_pose"]]
    poses[2][0] += 1e-5
    scenarios[1] = {**scenarios[1], "start": {**scenarios[1]["start"], "object_pose": poses}}
    (tmp_path / "run").mkdir()
    Suite(scenarios).write(tmp_path / "run")
    with pytest.raises(
        OneDemoError, match=r"scenario 1 \(seed 1\): start\.object_pose\[2\]\[0\] is drawn as .* frozen"
    ):
        completed(grid, tmp_path / "run", Serial(EpisodeJobs()))


REFUSED = {
    "a robot that does not fit": (
        "sweep: {task: [stack, bimanual_pour]}\ndefaults:\n"
        "  - {when: {task: stack}, set: {demonstration: stack}}\n"
        "  - {when: {task: bimanual_pour}, set: {demonstration: pour}}\n",
        "robot: .*Panda.* \\(in the cell bimanual_pour Panda L1 screw\\); `exclude:` leaves combinations out",
    ),
    "a number of blocks": (
        "demonstration: stack\nsweep: {env.n_blocks: [3, 9]}\n",
        "env.n_blocks: 9 is not a whole number from 1 to 6 \\(in the cell stack Panda L1 screw env.n_blocks=9\\)",
    ),
    "the paper's obstacles": (
        "task: pour\ndemonstration: pour\nobstacles: paper\n",
        "obstacles: the paper shows no obstacle in pour",
    ),
}


@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_is_refused_before_anything_runs(name, tmp_path):
    text, message = REFUSED[name]
    task = "" if "task:" in text else "task: stack\n"
    grid = grid_in(tmp_path, f"name: x\nepisodes: 2\n{task}{text}")
    with pytest.raises(BadConfig, match=message) as caught:
        completed(grid, tmp_path / "run", Serial(EpisodeJobs()))
    assert "\n" not in str(caught.value)
    assert not (tmp_path / "run" / "episodes.jsonl").exists()


def test_what_a_policy_raises_is_a_failure_of_its_own(tmp_path, monkeypatch):
    from onedemo.baselines.screw_policy import ScrewPolicy

    def broken(self, observation, memory):
        raise ZeroDivisionError("float division\nby zero")

    monkeypatch.setattr(ScrewPolicy, "act", broken)
    grid = grid_in(tmp_path, GRID.partition("sweep")[0])
    records = completed(grid, tmp_path / "run", Serial(EpisodeJobs()))
    for record in records.values():
        assert (record.failure_reason, record.success) == (ERROR, False)
        assert record.detail == "ZeroDivisionError: float division by zero"
        assert record.scenario


def test_a_trajectory_that_cannot_be_written_is_no_failure_of_the_policy(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "trajectories").touch()
    grid = grid_in(tmp_path, GRID.partition("sweep")[0].replace("video", "trajectories: true\nvideo"))
    with pytest.raises(OSError, match="trajectories"):
        completed(grid, tmp_path / "run", Serial(EpisodeJobs()))
    assert (tmp_path / "run" / "episodes.jsonl").read_bytes() == b""


def test_environments_of_a_worker_are_few(monkeypatch, tmp_path):
    from onedemo.bench.run import episode_jobs

    monkeypatch.setattr(episode_jobs, "MAX_ENVIRONMENTS", 2)
    grid = grid_in(tmp_path, GRID.replace("[0.2, 0.5]}", "[0.5], env.n_blocks: [2, 3, 4]}"))
    bench = EpisodeJobs()
    seen = []
    for cell in sorted(grid.cells, key=lambda cell: cell.env["n_blocks"]):
        seen.append(bench.prepared(cell)[0])
        assert bench.prepared(cell)[0] is seen[-1]
        assert len(bench._environments) <= 2
    assert len(set(map(id, seen))) == 3, "levels share an environment"
    bench.close()


@pytest.mark.slow
def test_five_hundred_episodes_leave_nothing_in_memory(tmp_path):
    grid = grid_in(tmp_path, GRID.replace("max_seconds: 3", "max_seconds: 0.3").replace("episodes: 2", "episodes: 125"))
    bench, sizes = EpisodeJobs(), []
    for k in range(125):
        for cell in grid.cells:
            values = cell.model_dump(mode="json")
            (drawn,) = bench.do({"kind": "draw", "cell": values, "indices": [k]})["drawn"]
            job = {"kind": "episode", "cell": values, "index": k, "start": drawn["start"], "scenario": ""}
            assert "record" in bench.do(job)
        sizes.append(int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20)
    # what is drawn at a new level for the first time is warm after some of them
    assert sizes[-1] - sizes[40] < 1.0


def test_no_room_is_a_scenario_that_cannot_be_drawn(monkeypatch, tmp_path):
    from onedemo.envs.core import environment as base
    from onedemo.envs.errors import NoRoom

    drawn = base.TaskEnv._started

    def sometimes(self, options):
        start = drawn(self, options)
        if self.np_random.uniform() < 0.5:
            raise NoRoom("static")
        return start

    monkeypatch.setattr(base.TaskEnv, "_started", sometimes)
    grid = grid_in(tmp_path, GRID.partition("sweep")[0].replace("episodes: 2", "episodes: 6"))
    records = completed(grid, tmp_path / "run", Serial(EpisodeJobs()))
    suite = read_suite(tmp_path / "run")
    out = [each["index"] for each in suite.scenarios if "infeasible" in each]
    assert 0 < len(out) < 6
    assert sorted(index for _, index in records) == [k for k in range(6) if k not in out]
    assert f"{len(out)} could not be drawn at all and are left out" in suite.summary()
