"""Videos of failures, recorded by running an episode once more; `videos` says of which."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from ...baselines.policy import Policy
from ...configs.grid import RunConfig
from .episode import run_episode
from .episode_records import EpisodeRecord
from .failure_selection import video_of
from .first_episode import EVERY, Film
from .scenarios import Scenario


class _NoPicture(Exception):
    """What is not seen need not be run to its end."""


def record_video(env: Any, policy: Policy, record: EpisodeRecord, config: RunConfig, folder: Path) -> str:
    """Run an episode once more and write its video; "" or why there is none. A video that is there is kept.

    Args:
        env: the environment of the episode's cell, which can draw.
        policy: its policy.
        record: what came of the episode.
        config: of its cell.
        folder: the run folder.
    """
    path = folder / video_of(record).file
    if path.exists():
        return ""
    path.parent.mkdir(parents=True, exist_ok=True)
    film, seen = Film(path), [0]

    def take(env: Any, observation: Any) -> None:
        if seen[0] % EVERY == 0:
            film.take(env)
        seen[0] += 1
        if film.problem:
            raise _NoPicture

    with suppress(_NoPicture), film:
        run_episode(env, policy, Scenario(record.index, record.seed, record.level), config, take)
    return film.problem
