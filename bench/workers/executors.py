"""Executors of jobs: this process, worker processes, or Ray actors. The results are the same, bit for bit."""

from __future__ import annotations

import os
import time
from collections import deque
from collections.abc import Iterator, Sequence
from pathlib import Path

from ...configs.run_config import RunSettings
from .dispatcher import Dispatcher, Executor, Job, Outcome
from .worker_process import JobHandler


class Serial:
    """Executor in this process: no time limits, and a crash of an episode ends the run.

    Args:
        handler: does the jobs.
    """

    workers = 1

    def __init__(self, handler: JobHandler) -> None:
        self._handler = handler

    def __enter__(self) -> Serial:
        return self

    def __exit__(self, *_: object) -> None:
        self._handler.close()

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """Yield the outcomes in order; see `Executor`."""
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        while waiting:
            job, begun = waiting.popleft(), time.monotonic()
            yield Outcome(job, self._handler.do(job), "", time.monotonic() - begun)


def executor_for(settings: RunSettings, handler: type[JobHandler], jobs: int, log: Path | None) -> Executor:
    """Return the executor that a config names.

    Args:
        settings: `executor`, `workers`, `address` and `wall_seconds` are used.
        handler: class that does the jobs; its module, run as a program, is a worker process.
        jobs: number of jobs; no more workers than that are started.
        log: file for the output of worker processes; None: it is discarded.

    Raises:
        BadConfig: Ray is requested, but not installed or not reachable.
    """
    if settings.executor == "serial":
        return Serial(handler())
    workers = max(1, min(settings.workers or cores(), jobs))
    if settings.executor == "process":
        from .processes import Processes, command_of

        return Dispatcher(Processes(command_of(handler), log), workers, settings.wall_seconds)
    from .ray_actors import RayActors

    backend = RayActors(settings.address, workers, handler, log)
    return Dispatcher(backend, workers, settings.wall_seconds)


def cores() -> int:
    """Return the number of processor cores that this process may use."""
    return len(os.sched_getaffinity(0))
