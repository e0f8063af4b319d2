"""Failure videos, recorded by running an episode once more; see `failure_selection` for the choice."""

from __future__ import annotations

from contextlib import suppress
from pathlib import Path
from typing import Any

from ...baselines import Policy
from ...configs import RunConfig
from .episode import run_episode
from .episode_records import EpisodeRecord
from .failure_selection import video_of
from .first_episode import EVERY, Film
from .scenarios import Scenario


class _NoPicture(Exception):
    """Stops an episode whose pictures cannot be drawn."""


def record_video(env: Any, policy: Policy, record: EpisodeRecord, config: RunConfig, folder: Path) -> str:
    """Run an episode once more and write its video, unless the video exists.

    Args:
        env: environment of the episode's cell, with rendering.
        policy: policy of the cell.
        record: record of the episode.
        config: config of the cell.
        folder: the run folder.

    Returns:
        "" or the reason why there is no video.
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
