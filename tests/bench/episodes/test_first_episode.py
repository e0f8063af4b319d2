"""A video appears under its name only when all of it is there."""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import gymnasium as gym
import numpy as np
import pytest
from imageio_ffmpeg import count_frames_and_secs

import onedemo.envs  # noqa: F401  (registers the ids)
from onedemo.bench.episodes.episode import run_episode
from onedemo.bench.episodes.failure_selection import video_of, videos_in
from onedemo.bench.episodes.failure_videos import record_video
from onedemo.bench.episodes.first_episode import Film
from onedemo.bench.episodes.scenarios import Scenario
from onedemo.configs.grid import RunConfig
from onedemo.envs.errors import RenderingUnavailable


class Noise:
    """An environment that draws noise, which does not compress."""

    rng = np.random.default_rng(0)

    def render(self):
        return self.rng.integers(0, 255, (480, 640, 3), dtype=np.uint8)


def test_a_finished_video_has_its_name_and_all_its_pictures(tmp_path):
    with Film(tmp_path / "a.mp4") as film:
        for _ in range(7):
            film.take(Noise())
    assert film.problem == ""
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    assert count_frames_and_secs(tmp_path / "a.mp4")[0] == 7


@pytest.mark.parametrize("error", [KeyboardInterrupt, ValueError])
def test_a_video_that_is_broken_off_leaves_no_file(error, tmp_path):
    (tmp_path / "a.mp4").write_bytes(b"an earlier one")
    with pytest.raises(error), Film(tmp_path / "a.mp4") as film:
        for _ in range(3):
            film.take(Noise())
        raise error
    assert [path.name for path in tmp_path.iterdir()] == ["a.mp4"]
    assert (tmp_path / "a.mp4").read_bytes() == b"an earlier one"


def test_without_a_drawing_library_there_is_a_reason_and_no_file(tmp_path):
    class Blind:
        def render(self):
            raise RenderingUnavailable("no EGL")

    with Film(tmp_path / "a.mp4") as film:
        film.take(Blind())
    assert "no EGL" in film.problem
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("limit", [100, 300_000])
def test_a_full_disk_is_one_line_and_no_file(limit, tmp_path):
    """At the first byte, and in the middle; FFmpeg inherits the limit."""
    code = """
import resource, signal, sys
from pathlib import Path
sys.path.insert(0, sys.argv[2])
from test_first_episode import Film, Noise
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
limit = int(sys.argv[3])
resource.setrlimit(resource.RLIMIT_FSIZE, (limit, limit))
with Film(Path(sys.argv[1])) as film:
    for _ in range(20):
        film.take(Noise())
print(film.problem)
"""
    run = [sys.executable, "-c", code, str(tmp_path / "a.mp4"), str(Path(__file__).parent), str(limit)]
    done = subprocess.run(run, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    (line,) = done.stdout.splitlines()
    assert "the video could not be written" in line
    assert list(tmp_path.iterdir()) == []


class Still:
    """A policy that does nothing."""

    def predict(self, observation, state=None, episode_start=None, deterministic=True):
        return np.zeros(8), None


def test_a_failure_is_filmed_once_or_there_is_a_reason(tmp_path):
    env = gym.make("onedemo/Stack-v0", render_mode="rgb_array", max_episode_steps=9)
    config = RunConfig(name="x", task="stack", method="still", demonstration="stack")
    record, _ = run_episode(env, Still(), Scenario(3, 7, "L1"), config)
    assert record.failure_reason == "timeout"
    problem = record_video(env, Still(), record, config, tmp_path)
    path = tmp_path / video_of(record).file
    assert path.exists() == (problem == "")
    if path.exists():
        written = path.stat().st_mtime_ns
        assert count_frames_and_secs(path)[0] == 3
        assert record_video(env, Still(), record, config, tmp_path) == ""
        assert path.stat().st_mtime_ns == written
        assert [video.index for video in videos_in(tmp_path)] == [3]
    env.close()
