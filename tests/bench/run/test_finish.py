"""What follows the last episode: videos, tried once, of what can be seen again, and what the terminal says."""

from __future__ import annotations

import json
from dataclasses import replace

from helpers.fake_runs import GRID, completed, dispatcher, grid_in
from imageio_ffmpeg import count_frames_and_secs

from onedemo.bench.episodes.episode_records import result_of
from onedemo.bench.episodes.failure_selection import FILMED, MOST, videos_in
from onedemo.bench.run.episode_jobs import EpisodeJobs
from onedemo.bench.run.finish import film, report
from onedemo.bench.workers.dispatcher import HUNG, WORKER_DIED, Outcome
from onedemo.bench.workers.executors import Serial

SHORT = "name: short\ntask: stack\ndemonstration: stack\nepisodes: 2\nlevel: L4\nmax_seconds: 0.2\n"


class Remembering:
    """An executor that does nothing but take down what it is asked for, and fails at it."""

    workers = 1

    def __init__(self, answer):
        self.jobs, self.answer = [], answer

    def __enter__(self):
        return self

    def __exit__(self, *_):
        pass

    def results(self, jobs):
        self.jobs += jobs
        return (Outcome(job, self.answer, "" if self.answer else WORKER_DIED, 0.0) for job in jobs)


def failing(grid, folder, reasons):
    """The records of a run, each failed for one of the reasons in turn."""
    records = completed(grid, folder, dispatcher())
    ordered = sorted(records.values(), key=lambda record: record.key)
    return [
        replace(record, success=False, failure_reason=reasons[k % len(reasons)]) for k, record in enumerate(ordered)
    ]


def test_failures_are_filmed_once_and_what_was_lost_is_not(tmp_path):
    grid = grid_in(tmp_path)
    folder = tmp_path / "run"
    records = failing(grid, folder, ["dropped", WORKER_DIED, "timeout", HUNG])
    # a worker that hung and a task that took too long go by the same word
    lost = [replace(record, seconds=0.0) if k % 4 in (1, 3) else record for k, record in enumerate(records)]
    executor = Remembering({"problem": "nothing to be seen"})
    film(executor, grid, folder, lost)
    assert {job["record"]["failure_reason"] for job in executor.jobs} == {"dropped", "timeout"}
    assert len(executor.jobs) == 2
    assert set(json.loads((folder / FILMED).read_text()).values()) == {"nothing to be seen"}
    film(executor, grid, folder, reversed(lost))
    assert len(executor.jobs) == 2, "in the order of the cells, and not again"
    lines = report(folder)
    assert "no video of failures: nothing to be seen" in lines
    assert "Failures without a video: nothing to be seen." in (folder / "report.md").read_text()


def test_videos_are_few_and_a_worker_that_dies_is_said(tmp_path):
    grid = grid_in(tmp_path, GRID.replace("episodes: 12", "episodes: 20"))
    folder = tmp_path / "run"
    executor = Remembering(None)
    film(executor, grid, folder, failing(grid, folder, [f"kind_{k}" for k in range(20)]))
    assert len(executor.jobs) == MOST
    assert set(json.loads((folder / FILMED).read_text()).values()) == {"the worker: worker_died"}


def test_a_worker_films_the_failure_that_was_recorded(tmp_path):
    grid = grid_in(tmp_path, SHORT)
    folder = tmp_path / "run"
    records = completed(grid, folder, Serial(EpisodeJobs()))
    with Serial(EpisodeJobs()) as executor:
        film(executor, grid, folder, records.values())
    ((file, problem),) = json.loads((folder / FILMED).read_text()).items()
    assert file == f"videos/{grid.cells[0].digest()}-0-0-timeout.mp4"
    assert (folder / file).is_file() == (problem == "")
    if not problem:
        assert count_frames_and_secs(folder / file)[0] == 3
        assert [video.file for video in videos_in(folder)] == [file]
        assert f"failure {folder / file}" in report(folder)
    again = completed(grid, folder, Serial(EpisodeJobs()))
    assert {key: result_of(record) for key, record in again.items()} == {
        key: result_of(record) for key, record in records.items()
    }
