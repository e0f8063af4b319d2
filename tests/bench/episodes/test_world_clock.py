"""The world that goes on while a policy computes, and observations that come late."""

from __future__ import annotations

from dataclasses import asdict, replace
from types import SimpleNamespace

import gymnasium as gym
import numpy as np
import pytest
from helpers.example_records import RECORD, some
from helpers.fake_runs import ONE_CELL, completed, dispatcher, grid_in

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.baselines import make_policy
from onedemo.bench.episodes.episode import episode_record, play
from onedemo.bench.episodes.episode_records import FILE, encoded, known_record, result_of
from onedemo.bench.episodes.run_folder import table_hash
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.bench.episodes.world_clock import PacedWorld, Pacing
from onedemo.bench.run.episode_jobs import EpisodeJobs
from onedemo.configs import BadConfig, RunConfig, load_demonstration
from onedemo.configs.grid import grid_of

DT = 0.02
CELL = {"name": "x", "task": "stack", "demonstration": "stack"}


class Count:
    """An environment that observes the number of its steps and keeps the actions."""

    control_dt, action_space = DT, SimpleNamespace(shape=(3,))

    def __init__(self, limit=10_000):
        self.actions, self.limit = [], limit

    @property
    def unwrapped(self):
        return self

    def reset(self, seed, options):
        return 0, {}

    def step(self, action):
        self.actions.append(np.array(action))
        return len(self.actions), 0.0, False, len(self.actions) >= self.limit, {}


class Thinker:
    """A policy with a clock of its own: each call takes the CPU time that is written down for it.

    Args:
        seconds: CPU times of the answers [s].
        hold_seconds: CPU time of choosing a held step [s]; None: there is no method for it.
    """

    def __init__(self, *seconds, hold_seconds=None):
        self.now, self.left, self.seen, self.held_at = 0.0, list(seconds), [], []
        if hold_seconds is not None:
            self.hold_seconds, self.hold = hold_seconds, self._hold

    def predict(self, observation, state=None):
        self.now += self.left.pop(0)
        self.seen.append(observation)
        return np.full(3, 1.0), state

    def _hold(self, observation, state):
        self.now += self.hold_seconds
        self.held_at.append(observation)
        return np.array([0.5, 0.5, 0.0])


def played(policy, *, clock="real", delay=0, limit=10_000):
    """The environment after all answers of a policy, and the world between them."""
    env, watched = Count(limit), []
    world = PacedWorld(env, Pacing(clock, delay, lambda: policy.now), lambda env, seen: watched.append(seen))
    world.begin(Scenario(0, 0, "L1"))
    while policy.left and not world.over:
        action, state = world.timed_call(lambda: policy.predict(world.seen))
        world.hold(policy, state)
        world.step(action)
    assert watched == list(range(world.steps + 1)), "measurements are of every step, and never late"
    return env, world


@pytest.mark.parametrize(
    "seconds, held",
    [(0.0, 0), (0.001, 0), (DT, 0), (1.001 * DT, 1), (2 * DT, 1), (3 * DT, 2), (3.5 * DT, 3), (1.0, 49)],
)
def test_a_call_within_a_period_costs_nothing_and_each_further_one_a_held_step(seconds, held):
    env, world = played(Thinker(seconds, 0.0))
    assert (world.held, world.steps) == (held, held + 2)
    assert [bool(action.any()) for action in env.actions] == [False] * held + [True, True]


def test_the_world_waits_unless_it_is_told_not_to():
    policy = Thinker(1.0, 2.0, hold_seconds=0.1)
    _, world = played(policy, clock="waits")
    assert (world.steps, world.held, policy.held_at, world.cpu_seconds) == (2, 0, [], [1.0, 2.0])


def test_after_held_steps_the_policy_sees_the_newest_observation():
    policy = Thinker(3 * DT, 0.0, 2 * DT, 0.0)
    played(policy)
    assert policy.seen == [0, 3, 4, 6]


def test_a_guarded_hold_acts_on_the_observation_of_its_tick():
    policy = Thinker(4 * DT, 0.0, hold_seconds=0.0)
    env, world = played(policy)
    assert policy.held_at == [0, 1, 2] and world.held == 3
    assert [action[0] for action in env.actions] == [0.5, 0.5, 0.5, 1.0, 1.0]


def test_the_time_of_a_guarded_hold_counts_but_does_not_lead_to_further_ones():
    policy = Thinker(3 * DT, 0.0, hold_seconds=2 * DT)
    env, world = played(policy)
    assert policy.held_at == [0, 1] and world.held == 6  # 3 + 2 * 2 periods, less the first
    assert [action[0] for action in env.actions] == [0.5, 0.5, 0.0, 0.0, 0.0, 0.0, 1.0, 1.0]


def test_a_policy_may_choose_the_plain_hold():
    policy = Thinker(2 * DT, 0.0)
    policy.hold = lambda observation, state: None
    env, _ = played(policy)
    assert not env.actions[0].any()


def test_the_time_limit_of_an_episode_counts_held_steps_and_takes_no_action_after_it():
    env, world = played(Thinker(10 * DT, 0.0), limit=4)
    assert world.over and (world.steps, world.held) == (4, 4)
    assert not np.any(env.actions)


@pytest.mark.parametrize("delay, seen", [(0, [0, 1, 2, 3, 4]), (1, [0, 0, 1, 2, 3]), (3, [0, 0, 0, 0, 1])])
def test_observations_are_late_by_the_delay_and_begin_with_the_first(delay, seen):
    policy = Thinker(*[0.0] * 5)
    played(policy, clock="waits", delay=delay)
    assert policy.seen == seen


def test_observations_of_held_steps_are_late_too():
    policy = Thinker(4 * DT, 0.0, hold_seconds=0.0)
    played(policy, delay=2)
    assert (policy.seen, policy.held_at) == ([0, 2], [0, 0, 0])


@pytest.fixture(scope="module")
def env():
    made = gym.make("onedemo/Stack-v0", level="L4", n_blocks=1, max_episode_steps=400)
    yield made
    made.close()


def recorded(env, pacing, method="screw", settings=None):
    """The record of an episode with obstacles, of a cell that says the same of the clock."""
    config = RunConfig(**CELL, method=method, level="L4", clock=pacing.clock, delay=pacing.delay)
    policy = make_policy(method, env.unwrapped.task, load_demonstration("stack"), settings)
    scenario = Scenario(0, 3, "L4")
    return episode_record(env, play(env, policy, scenario, pacing=pacing), scenario, config)


def result(record):
    return {**result_of(record), "cell": "", "clock": "", "delay": 0}


def test_a_clock_that_costs_nothing_changes_no_bit(env):
    free = Pacing("real", cpu=lambda: 0.0)
    waiting, live = recorded(env, Pacing()), recorded(env, free)
    assert result(live) == result(waiting)
    assert (waiting.clock, live.clock, live.held, live.longest_ms) == ("waits", "real", 0, 0.0)
    assert live.calls == round(live.seconds / DT) and waiting.longest_ms > 0.0


def test_a_delay_is_deterministic_and_changes_the_result(env):
    one, two, none = (recorded(env, Pacing(delay=delay)) for delay in (5, 5, 0))
    assert result_of(one) == result_of(two)
    assert result_of(one)["delay"] == 5 and result(one) != result(none)


@pytest.mark.parametrize("method", ["screw", "replay"])
def test_time_that_is_thought_about_passes_for_program_policies(env, method):
    ticks = iter(range(10**6))
    record = recorded(env, Pacing("real", cpu=lambda: 0.03 * next(ticks)), method)
    # every call takes 0.03 s, so one held step each; asking for its action takes as long, and costs another one
    assert record.held == pytest.approx(2 * record.calls, abs=2)
    assert record.seconds == pytest.approx((record.calls + record.held) * DT, abs=2 * DT)


def test_only_reproducible_results_have_a_hash():
    records = some(3)
    live = replace(records[0], clock="real", index=7, seconds=99.0)
    assert table_hash([*records, live]) == table_hash(records)
    assert "clock" not in result_of(RECORD) and result_of(replace(RECORD, delay=2))["delay"] == 2
    timed = replace(RECORD, calls=9, slow_calls=2, longest_ms=3.0, held=0)
    assert result_of(timed) == result_of(RECORD)
    old = {key: value for key, value in asdict(RECORD).items() if key not in ("clock", "delay", "calls", "held")}
    assert known_record(old) == RECORD
    assert b'"clock":"real"' in encoded(live)


def test_a_worker_rehearses_before_it_is_timed_and_answers_with_the_clock(tmp_path):
    cell = RunConfig(**CELL, clock="real", delay=1, max_seconds=1.0, env={"n_blocks": 1}).model_dump(mode="json")
    bench = EpisodeJobs()
    drawn = bench.do({"kind": "draw", "cell": cell, "indices": [0]})["drawn"][0]
    record = known_record(bench.do({"kind": "episode", "cell": cell, "index": 0, "scenario": "", **drawn})["record"])
    bench.close()
    assert (record.clock, record.delay, record.seconds) == ("real", 1, 1.0)
    assert record.calls + record.held == 50


def test_a_run_with_a_real_clock_continues_where_it_stopped(tmp_path):
    grid, folder = grid_in(tmp_path, f"{ONE_CELL}clock: real\ndelay: 2\n"), tmp_path / "run"
    first = completed(grid, folder, dispatcher())
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    (folder / FILE).write_bytes(b"".join(lines[:7]) + lines[7][:20])
    again = completed(grid, folder, dispatcher())
    assert set(again) == set(first) and len((folder / FILE).read_bytes().splitlines()) == 12


def test_clock_and_delay_are_keys_of_a_cell_like_any_other():
    plain = RunConfig(**CELL)
    assert plain == RunConfig(**CELL, clock="waits", delay=0)
    assert not {"clock", "delay"} & set(plain.model_dump(mode="json"))
    sweep = {"clock": ["waits", "real"], "delay": [0, 3]}
    grid = grid_of({**CELL, "sweep": sweep}, "mine.yaml")
    assert [cell.condition for cell in grid.cells] == ["L1", "L1 delay 3", "L1 real clock", "L1 real clock delay 3"]
    assert grid.label(grid.cells[0]) == "stack Panda L1 screw"
    assert grid.label(grid.cells[3]) == "stack Panda L1 screw clock=real delay=3"
    assert len({cell.digest() for cell in grid.cells}) == 4
    assert grid.cells[0].digest() == plain.digest()


@pytest.mark.parametrize(
    "change, message",
    [
        ("clock=reel", "command line: clock: input should be 'waits' or 'real', got 'reel'"),
        ("delay=-1", "command line: delay: input should be greater than or equal to 0, got -1"),
        ("delay=0.1", "command line: delay: input should be a valid integer, got 0.1"),
        ("clok=real", "command line: clok: unknown key; did you mean 'clock'?"),
    ],
)
def test_a_misspelt_clock_is_refused_in_one_line(change, message):
    with pytest.raises(BadConfig) as caught:
        grid_of(dict(CELL), "mine.yaml", [change])
    assert str(caught.value).startswith(message) and "\n" not in str(caught.value)
