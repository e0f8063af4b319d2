"""Training: the same curve however often it is interrupted, whoever runs it; mistakes in one line."""

from __future__ import annotations

import json
import os
import re
import signal
import subprocess
import sys
import time
from dataclasses import asdict
from io import StringIO
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from rich.console import Console

from onedemo.bench.train import command
from onedemo.bench.train.curve_figure import mean_interval, summary_rows
from onedemo.bench.train.evaluations import Point
from onedemo.bench.train.folder import curve_of
from onedemo.bench.train.progress import EVERY, progress, steps_done, writing_steps
from onedemo.configs.errors import BadConfig
from onedemo.configs.learner_arguments import DEFAULTS
from onedemo.configs.shipped_files import FOLDER, shipped_training
from onedemo.configs.train_config import ALGORITHMS, TRAIN_KEYS, load_training

SMALL = [
    "steps=600",
    "evaluate_every=300",
    "evaluate_episodes=2",
    "seeds=1",
    "executor=serial",
    "learner.hidden=[16,16]",
]
EXTRA = {
    "sac": ["learner.learning_starts=100", "learner.batch_size=32"],
    "sac-her": ["learner.learning_starts=160", "learner.batch_size=32"],
    "ppo": ["learner.n_steps=75", "learner.batch_size=50", "learner.n_epochs=2", "learner.envs=4"],
    "bc": ["learner.batch_size=16"],
}
ROOT = Path(__file__).parents[3]
SHIPPED = sorted(path.stem for path in (FOLDER / "train").glob("*.yaml"))


@pytest.fixture(autouse=True)
def with_torch():
    pytest.importorskip("torch", reason="the extra rl is not installed")
    pytest.importorskip("stable_baselines3", reason="the extra rl is not installed")


def small(algorithm, *changes):
    task = "reach" if algorithm in ("sac", "ppo", "sac-her") else "place_one"
    more = EXTRA.get(algorithm, EXTRA["sac"])
    return [f"task={task}", f"algorithm={algorithm}", *SMALL, *more, *changes]


def test_a_training_with_other_defaults_is_another_training(monkeypatch):
    config = load_training(shipped_training("reach_sac"))
    before = config.digest()
    assert (
        load_training(shipped_training("reach_sac"), [f"learner.gamma={DEFAULTS['sac']['gamma']}"]).digest() == before
    )
    monkeypatch.setitem(DEFAULTS["sac"], "gamma", 0.5)
    assert config.digest() != before


def trained(folder, algorithm, *changes):
    """The folder of a small training."""
    assert command.run_training("reach_sac", small(algorithm, *changes), folder, quiet=True) == 0
    config = load_training(shipped_training("reach_sac"), small(algorithm, *changes))
    return config, folder / f"{config.name}-{config.digest()}"


def results(folder, seed=0):
    """Everything of a curve that must be the same again."""
    return [
        {key: value for key, value in asdict(point).items() if key != "seconds"} for point in curve_of(folder, seed)
    ]


@pytest.mark.parametrize("algorithm", ALGORITHMS)
def test_a_training_that_goes_on_ends_as_one_that_never_stopped(algorithm, tmp_path):
    _, whole = trained(tmp_path / "whole", algorithm)
    trained(tmp_path / "parts", algorithm, "steps=300")
    _, parts = trained(tmp_path / "parts", algorithm)
    assert whole.name == parts.name, "more steps are no other training"
    assert [point["steps"] for point in results(whole)] == [300, 600]
    assert results(parts) == results(whole)
    assert (parts / "actor.safetensors").read_bytes() == (whole / "actor.safetensors").read_bytes()
    assert (whole / "curve.png").exists() and (whole / "curve.csv").read_text().count("\n") == 3
    for name, key in (("success_rate", "successes"), ("mean_reward", "returns")):
        steps, values = events(parts / "seed-0" / "tensorboard", f"eval/{name}")
        assert steps == [300, 600]
        assert values == pytest.approx([np.mean(point[key]) for point in results(parts)])


def events(folder, name):
    """Steps and values of a scalar, as TensorBoard shows them."""
    from tensorboard.backend.event_processing.event_accumulator import EventAccumulator

    assert not [path for path in folder.iterdir() if path.is_dir()], "a finished round is shown as a run of its own"
    seen = EventAccumulator(str(folder))
    seen.Reload()
    scalars = seen.Scalars(name)
    return [scalar.step for scalar in scalars], [scalar.value for scalar in scalars]


def test_steps_are_told_between_evaluations_too(tmp_path):
    config = load_training(shipped_training("reach_sac"), ["steps=10000", "evaluate_every=5000", "seeds=3"])
    assert steps_done(config, tmp_path, {0: 0, 1: 0, 2: 0}) == 0
    for seed, done in ((0, 1250), (1, 7000)):
        (tmp_path / f"seed-{seed}").mkdir()
        callback = writing_steps(tmp_path / f"seed-{seed}")
        for steps in range(1, done + 1):
            assert callback({"self": SimpleNamespace(num_timesteps=steps)}, {})
    # the last seed was trained with more steps before than are wanted now
    assert steps_done(config, tmp_path, {0: 0, 1: 1, 2: 3}) == pytest.approx(1250 + 7000 + 10_000, abs=2 * EVERY)
    screen = Console(file=StringIO(), force_terminal=True)
    with progress(lambda: steps_done(config, tmp_path, {0: 0, 1: 1, 2: 3}), 30_000, screen) as bars:
        bars.refresh()
        assert bars.tasks[0].completed > 17_000


def test_an_actor_acts_in_a_comparison_as_it_was_evaluated(tmp_path):
    from onedemo.bench.episodes.episode import run_episode
    from onedemo.bench.episodes.scenarios import Scenario
    from onedemo.bench.run.episode_jobs import made, policy_for
    from onedemo.configs.run_config import RunConfig

    _, folder = trained(tmp_path, "bc", "evaluate_episodes=3")
    settings = {"checkpoint": str(folder / "actor.json")}
    cell = RunConfig(name="x", task="place_one", method="bc", demonstration="stack", settings=settings)
    env = made(cell)
    policy = policy_for(env, cell)
    records = [run_episode(env, policy, Scenario(seed, seed, "L1"), cell)[0] for seed in range(3)]
    assert [record.success for record in records] == list(curve_of(folder, 0)[-1].successes)


def test_a_killed_training_loses_at_most_a_leg(tmp_path):
    _, whole = trained(tmp_path / "whole", "sac")
    arguments = ["train", "reach_sac", *small("sac"), "--output", str(tmp_path / "killed"), "--quiet"]
    code = "import sys; from onedemo.bench.cli import main; main()"
    for _ in range(2):
        process = subprocess.Popen([sys.executable, "-c", code, *arguments], stdout=subprocess.DEVNULL)
        folder = tmp_path / "killed" / whole.name / "seed-0"
        deadline = time.monotonic() + 300
        while not list(folder.glob("leg-*")) and process.poll() is None and time.monotonic() < deadline:
            time.sleep(0.05)
        os.kill(process.pid, signal.SIGKILL)
        process.wait()
    assert command.run_training("reach_sac", small("sac"), tmp_path / "killed", quiet=True) == 0
    assert results(tmp_path / "killed" / whole.name) == results(whole)


def test_seeds_in_processes_are_those_in_this_one(tmp_path):
    _, serial = trained(tmp_path / "serial", "bc", "seeds=2")
    _, processes = trained(tmp_path / "processes", "bc", "seeds=2", "executor=process", "workers=2")
    for seed in (0, 1):
        assert results(processes, seed) == results(serial, seed)
    assert results(serial, 0) != results(serial, 1)


def test_another_config_does_not_go_on_from_this_state(tmp_path):
    _, folder = trained(tmp_path, "bc", "steps=300")
    state = folder / "seed-0" / "leg-00001" / "state.json"
    numbers = json.loads(state.read_text())
    state.write_text(json.dumps({**numbers, "digest": "0123456789ab"}))
    with pytest.raises(BadConfig, match=r"state\.json.*digest: is of the config 0123456789ab, not of [0-9a-f]{12}"):
        trained(tmp_path, "bc")


@pytest.mark.parametrize("file", ["state.json", "weights.safetensors"])
def test_a_damaged_state_is_named_with_what_helps(file, tmp_path):
    _, folder = trained(tmp_path, "bc", "steps=300")
    path = folder / "seed-0" / "leg-00001" / file
    path.write_bytes(path.read_bytes()[:40])
    with pytest.raises(BadConfig, match=r"leg-00001.*cannot be .*remove .* to begin this seed anew") as caught:
        trained(tmp_path, "bc")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change, message",
    [
        ("algoritm=sac", "command line: algoritm: unknown key; did you mean 'algorithm'"),
        ("algorithm=td3", "algorithm: input should be 'sac', 'ppo'"),
        ("steps=1000", "steps: 1000 is not a multiple of evaluate_every, 300: 900 or 1200"),
        ("task=juggle", "task: unknown task 'juggle'; known: insert_one, place_one, reach"),
        ("task=stack", "task: unknown task 'stack'; known: insert_one, place_one, reach, tilt_pour"),
        ("env.reward=sparse", "env.reward: is chosen by the algorithm"),
        ("env.colour=red", "env.colour: unknown key; allowed: arm, control_mode"),
        ("learner.momentum=1", "learner.momentum: unknown key; allowed: action_noise, batch_size"),
        ("learner.envs=2", "learner.envs: unknown key; .*arguments of sac"),
        ("learner.hidden=128", "learner.hidden: input should be a valid list, got 128"),
        ("learner.hidden=[128,-1]", r"learner.hidden: \[1\]: input should be greater than or equal to 1, got -1"),
        ("learner.learning_rate=fast", "learner.learning_rate: input should be a valid number.*, got 'fast'"),
        ("learner.gamma=1.5", "learner.gamma: input should be less than or equal to 1, got 1.5"),
        ("learner.buffer_size=0", "learner.buffer_size: input should be greater than or equal to 1, got 0"),
        ("device=abacus", "device: torch cannot use 'abacus' here: .*; auto takes what there is"),
        ("demonstration=pour", "task: is 'pour'; the task of this run is 'stack'"),
        ("level=L9", "level: unknown level 'L9'"),
    ],
)
def test_mistakes_are_one_line(change, message, tmp_path):
    with pytest.raises(Exception, match=message) as caught:
        command.run_training("reach_sac", small("sac", change), tmp_path, quiet=True)
    assert "\n" not in str(caught.value)
    assert not list(tmp_path.iterdir())


def test_a_config_that_is_not_there_is_one_line(tmp_path):
    with pytest.raises(BadConfig, match=r"nowhere\.yaml: no such file, and no training that is shipped: place_bc, "):
        command.run_training("nowhere.yaml", [], tmp_path)


def test_a_rollout_must_fit_between_evaluations(tmp_path):
    with pytest.raises(BadConfig, match=r"evaluate_every: 300 is not a multiple of .* 280"):
        command.run_training("reach_ppo", small("ppo", "learner.n_steps=70"), tmp_path)
    with pytest.raises(BadConfig, match=r"evaluate_every: 300 is not a multiple of learner.train_freq, 7"):
        command.run_training("reach_sac", small("sac", "learner.train_freq=7"), tmp_path)
    with pytest.raises(BadConfig, match=r"train_freq: \[1, 'episode'\] is not a positive whole number of steps"):
        command.run_training("reach_sac", small("sac", "learner.train_freq=[1, episode]"), tmp_path)


@pytest.mark.parametrize("name", SHIPPED)
def test_shipped_trainings_are_well(name):
    config = load_training(shipped_training(name))
    command.check(config)
    assert config.legs >= 5


def test_intervals_know_that_seeds_differ():
    alike, apart = [[True, False] * 25] * 4, [[True] * 50, [False] * 50] * 2
    assert np.ptp(mean_interval(apart)) > 2 * np.ptp(mean_interval(alike))
    low, high = mean_interval([[True] * 20] * 2)
    assert 0.9 < low < high == 1.0


def test_rows_are_where_all_seeds_have_been_evaluated():
    def point(seed, leg, success):
        return Point(seed, leg, 100 * leg, (success,) * 4, (2.0,) * 4, 1.0)

    curves = [[point(0, 1, False), point(0, 2, True)], [point(1, 1, True)]]
    assert [row[:2] + row[4:5] for row in summary_rows(curves)] == [(100, 0.5, 2.0)]


def test_the_page_has_every_key_of_a_config():
    page = (ROOT / "docs" / "learning.md").read_text(encoding="utf-8")
    table = page[page.index("## `onedemo train`") : page.index("## What a learner sees")]
    rows = [line.split("|")[1] for line in table.splitlines() if line.startswith("| `")]
    assert sorted(re.findall(r"`([a-z_]+)`", " ".join(rows))) == sorted(TRAIN_KEYS)
