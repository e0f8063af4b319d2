"""Where episodes run: in this process, in worker processes, or in Ray's actors. The results are the same bits."""

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
    """An executor in this process: nothing is limited in time, and what kills an episode kills the run.

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
        """The outcomes, in order."""
        waiting = jobs if isinstance(jobs, deque) else deque(jobs)
        while waiting:
            job, begun = waiting.popleft(), time.monotonic()
            yield Outcome(job, self._handler.do(job), "", time.monotonic() - begun)


def executor_for(settings: RunSettings, handler: type[JobHandler], jobs: int, log: Path | None) -> Executor:
    """The executor that a config names.

    Args:
        settings: `executor`, `workers`, `address` and `wall_seconds` of them.
        handler: does the jobs, in its module when that is run as a program.
        jobs: how many there will be: no more workers are started.
        log: file that takes what worker processes print.

    Raises:
        BadConfig: Ray is wanted, but not installed or not reachable.
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
    """Processor cores that this process may use."""
    return len(os.sched_getaffinity(0))
