"""Job handler for episodes: caches environments and policies, and runs jobs in them.

Jobs and answers are JSON mappings, so that any process can do the work:

| job | keys besides "cell" | answer |
|---|---|---|
| "prepare" | | {} |
| "draw" | "indices" | "drawn": per index a start, or the reason why there is none |
| "episode" | "index", "start", "scenario", "trajectories" (a folder or null) | "record" |
| "show" | "folder" | see `show` |
| "film" | "folder", "record" | "problem": why there is no video, or "" |

Mistakes of the user are answered by {"refused": text, "key": key}.
"""

from __future__ import annotations

import logging
import math
import time
import warnings
from collections import OrderedDict
from dataclasses import asdict, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ...configs import BadConfig, RunConfig
from ...configs.run_config import REAL, cell_of
from ...envs import facts_of
from ...envs.errors import NoRoom
from ...planner import Pose
from ...planner.errors import BadOption, OneDemoError
from ..episodes.episode_records import EpisodeRecord, known_record
from ..episodes.run_folder import FIGURE, VIDEO
from ..episodes.scenarios import Scenario, ScenarioChanged, scenarios_of
from ..method_table import WITHOUT_DEMONSTRATION
from ..workers.dispatcher import ERROR, Answer, Job
from ..workers.worker_process import main

if TYPE_CHECKING:
    from ...baselines import Policy

LOG = logging.getLogger("onedemo")
MAX_ENVIRONMENTS, MAX_POLICIES = 4, 32
"""Cache sizes of a worker."""


class EpisodeJobs:
    """Job handler of `onedemo run`."""

    def __init__(self) -> None:
        self._environments: OrderedDict[str, Any] = OrderedDict()
        self._policies: OrderedDict[str, Policy] = OrderedDict()

    def do(self, job: Job) -> Answer:
        """See `JobHandler`."""
        config = cell_of(job["cell"])
        try:
            env, policy = self.prepared(config)
            if job["kind"] == "draw":
                return {"drawn": [draw(env, config, index) for index in job["indices"]]}
            if job["kind"] == "episode":
                return {"record": asdict(episode(env, policy, config, job))}
            if job["kind"] == "show":
                return shown(policy, config, Path(job["folder"]))
            if job["kind"] == "film":
                return {"problem": filmed(policy, config, known_record(job["record"]), Path(job["folder"]))}
            return {}
        except OneDemoError as error:
            return refusal(error)

    def prepared(self, config: RunConfig) -> tuple[Any, Policy]:
        """Return the warm environment and policy of a cell, from the cache if possible.

        Raises:
            BadConfig: an unknown name or unusable value in the config, with its key.
            BadDemonstration: the demonstration belongs to another task.
        """
        place = environment_key(config)
        if place not in self._environments:
            self._environments[place] = made(config)
            for _ in range(len(self._environments) - MAX_ENVIRONMENTS):
                self._environments.popitem(last=False)[1].close()
        self._environments.move_to_end(place)
        env, own = self._environments[place], f"{place} {config.digest()}"
        if own not in self._policies:
            self._policies[own] = policy_for(env, config)
            if config.clock == REAL:
                from ..episodes.episode import rehearse

                rehearse(env, self._policies[own], config)
            for _ in range(len(self._policies) - MAX_POLICIES):
                self._policies.popitem(last=False)
        self._policies.move_to_end(own)
        return env, self._policies[own]

    def close(self) -> None:
        """Close all environments."""
        for env in self._environments.values():
            env.close()
        self._environments.clear()
        self._policies.clear()


def refusal(error: OneDemoError) -> Answer:
    """Return the answer for a mistake of the user, with the config key to blame or ""."""
    if isinstance(error, BadOption):
        return {"refused": error.reason, "key": error.option}
    return {"refused": str(error), "key": ""}


def environment_key(config: RunConfig) -> str:
    """Return the cache key of a config's environment; the level is absent, it is an option of `reset`."""
    return repr((config.task, config.robot, config.obstacles, sorted(config.env.items()), config.max_seconds))


def action_limit(config: RunConfig) -> int:
    """Return the time limit of an episode in actions."""
    facts = facts_of(config.task, load=True)
    seconds, usual = facts.seconds, facts.frequency
    wanted = seconds if config.max_seconds is None else config.max_seconds
    # the environment refuses invalid frequencies
    rate = config.env.get("control_frequency", usual)
    return max(1, round(wanted * rate)) if isinstance(rate, int) else round(seconds * usual)


def made(config: RunConfig, render_mode: str | None = None) -> Any:
    """Build the environment of a config and warm up the planner for it.

    Args:
        config: config of the cell.
        render_mode: see `gymnasium.make`.
    """
    import gymnasium as gym

    from ...baselines.warm_up import warm_up_for

    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        env: Any = gym.make(
            facts_of(config.task, load=True).id,
            robot=config.robot,
            level=config.level,
            obstacles=config.obstacles,
            render_mode=render_mode,
            max_episode_steps=action_limit(config),
            **config.env,
        )
    warm_up_for(env.unwrapped.task)
    return env


def policy_for(env: Any, config: RunConfig) -> Policy:
    """Build the policy of a config.

    Args:
        env: environment of the config.
        config: config of the cell.

    Raises:
        BadDemonstration: the demonstration belongs to another task.
        BadConfig: a setting cannot be used.
        BadOption: a setting does not fit the task.
    """
    from ...baselines import make_policy
    from .config_checks import fitting_demonstration

    shown, tool = fitting_demonstration(config), None
    if config.tool is not None:
        *position, turn = config.tool
        tool = Pose.from_yaw(position, math.radians(turn))
    return make_policy(config.method, env.unwrapped.task, shown, config.settings, key_poses=config.key_poses, tool=tool)


def draw(env: Any, config: RunConfig, index: int) -> Answer:
    """Draw the start of a scenario, with the number of rejected layouts; if there is none, return the reason.

    Args:
        env: environment of the config.
        config: config of the cell.
        index: index of the scenario.
    """
    from ..episodes.start_states import drawn_start

    scenario = scenarios_of(config)[index]
    try:
        observation, info = env.reset(seed=scenario.seed, options={"level": scenario.level})
    except NoRoom as error:
        return {"infeasible": error.reason}
    return {"start": drawn_start(env, observation), "refused": int(info["layouts_refused"])}


def episode(env: Any, policy: Policy, config: RunConfig, job: Job) -> EpisodeRecord:
    """Run an episode and return its record; an exception of the policy is recorded as a failure.

    Args:
        env: environment of the config.
        policy: policy of the config.
        config: config of the cell.
        job: see the module.

    Raises:
        ScenarioChanged: the environment draws another start than the frozen one.
        BadConfig: the start cannot be drawn.
    """
    from ..episodes.episode import episode_record, play
    from ..episodes.start_states import check_start, drawn_start
    from ..episodes.world_clock import Pacing

    scenario, started, checked = scenarios_of(config)[job["index"]], time.perf_counter(), False

    def observer(env: Any, observation: Any) -> None:
        nonlocal checked
        if not checked:
            checked = True
            check_start(scenario, job["start"], drawn_start(env, observation))

    kept = Path(job["trajectories"]) if job.get("trajectories") else None
    try:
        played = play(env, policy, scenario, observer, Pacing.of(config))
    except ScenarioChanged:
        raise
    except Exception as error:
        if not checked:
            raise BadConfig("config.yaml", "", f"scenario {scenario.index} cannot be drawn: {error}") from None
        LOG.info("%s, seed %d", config.method, scenario.seed, exc_info=True)
        detail = f"{type(error).__name__}: {error}"
        record = lost_record(config, scenario, ERROR, detail, time.perf_counter() - started)
    else:
        record = episode_record(env, played, scenario, config, kept)
    return replace(record, cell=config.digest(), scenario=job["scenario"])


def lost_record(config: RunConfig, scenario: Scenario, reason: str, detail: str, seconds: float) -> EpisodeRecord:
    """Return the record of an episode that the simulator could not judge: a failure, not counted as safe.

    Args:
        config: config of the cell.
        scenario: scenario of the episode.
        reason: `ERROR`, `WORKER_DIED` or `HUNG`.
        detail: explanation for the reader.
        seconds: real time [s] spent.
    """
    return EpisodeRecord(
        index=scenario.index,
        seed=scenario.seed,
        method=config.method,
        task=config.task_words,
        robot=config.robot,
        level=config.level,
        failure_reason=reason,
        detail=" ".join(detail.split())[:300],
        success=False, safe=False, stage="", collision="",
        seconds=0.0, contacts=0, clearance=None, refused=0, numbers={},
        wall_seconds=seconds,
        tick_us=[0.0, 0.0, 0.0, 0.0],
        cell=config.digest(),
        clock=config.clock,
        delay=config.delay,
    )  # fmt: skip


def shown(policy: Policy, config: RunConfig, folder: Path) -> Answer:
    """Call `show`; if it fails, answer with the reason why there is no figure.

    Args:
        policy: policy of the config.
        config: config of the cell.
        folder: run folder.
    """
    try:
        return show(policy, config, folder)
    except Exception as error:
        LOG.info("no figure", exc_info=True)
        return {"video": config.video, "figure_problem": f"{type(error).__name__}: {error}"}


def show(policy: Policy, config: RunConfig, folder: Path) -> Answer:
    """Draw figure and, if wanted, video of the first scenario; return the report's data on them.

    Args:
        policy: policy of the config.
        config: config of the cell.
        folder: run folder.
    """
    from ..episodes.episode_figure import draw_episode
    from ..episodes.first_episode import watch

    figure, video = folder / FIGURE, folder / VIDEO
    env = made(config, "rgb_array" if config.video else None)
    try:
        seen = watch(env, policy, scenarios_of(config)[0], config, video if config.video else None)
    finally:
        env.close()
    among = "" if config.obstacles in (None, "none") else f", obstacles {config.obstacles}"
    where = f"{config.task_words}, {config.robot}, {config.condition}{among}"
    shown = "no demonstration" if config.method in WITHOUT_DEMONSTRATION else "one demonstration"
    title = f"{where}, seed {config.seed}: {shown}, {config.method}"
    draw_episode(seen, title, [figure, figure.with_suffix(".pdf")])
    return {"speed": seen.speed, "video": config.video, "video_problem": seen.video_problem}


def filmed(policy: Policy, config: RunConfig, record: EpisodeRecord, folder: Path) -> str:
    """Replay an episode and record its video; return "", or why there is no video.

    Args:
        policy: policy of the config.
        config: config of the cell.
        record: record of the episode.
        folder: run folder.
    """
    from ..episodes.failure_videos import record_video

    env = made(config, "rgb_array")
    try:
        return record_video(env, policy, record, config, folder)
    except Exception as error:
        LOG.info("no video", exc_info=True)
        return f"{type(error).__name__}: {error}"
    finally:
        env.close()


if __name__ == "__main__":
    main(EpisodeJobs())
