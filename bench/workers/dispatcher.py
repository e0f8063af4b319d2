"""Dispatch of jobs to workers that may die or hang.

A worker does one job at a time. If it dies or exceeds its time limit, it is replaced and the job is retried once; if
the retry ends in the same way, only this job is lost, and the other workers continue.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from ...planner.errors import OneDemoError

ERROR, WORKER_DIED, HUNG = "error", "worker_died", "timeout"
"""Failure reasons that are not the task's: the policy raised an exception; the process that ran the episode died twice;
or it had to be killed twice, because the episode took too much real time."""
ATTEMPTS = 2
"""Number of attempts at a job."""
BUILD_SECONDS = 1200.0
"""Time limit [s] for compiling the kernels and building a scene and a policy."""
Job = dict[str, Any]
Answer = dict[str, Any]


class WorkerFailed(OneDemoError):
    """Failure of a worker that no config is to blame for."""


class Outcome(NamedTuple):
    """Result of a job.

    Attributes:
        job: the job as submitted.
        answer: answer of the worker; None if the job was lost.
        lost: "", `WORKER_DIED` or `HUNG`.
        seconds: real time [s] of the last attempt.
    """

    job: Job
    answer: Answer | None
    lost: str
    seconds: float


class Executor(Protocol):
    """Runner of jobs; a context manager that leaves nothing running at its end."""

    workers: int

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """Yield the outcomes as they arrive.

        A deque of jobs is consumed, and jobs may be appended to it while outcomes arrive.
        """
        ...

    def __enter__(self) -> Executor: ...

    def __exit__(self, *_: object) -> None: ...


class WorkerBackend(Protocol):
    """Start, feed, poll and stop workers of one kind."""

    def spawn(self) -> Any:
        """Start a worker and return its handle."""
        ...

    def ask(self, worker: Any, job: Job) -> None:
        """Give a job to an idle worker; if the worker is dead, `poll` reports that.

        Args:
            worker: handle from `spawn`.
            job: the job.
        """
        ...

    def poll(self, workers: Sequence[Any], seconds: float) -> list[tuple[Any, Answer | None]]:
        """Wait until at least one worker has answered or died.

        Args:
            workers: the busy workers.
            seconds: longest time [s] to wait.

        Returns:
            Worker and answer of those that have answered; the answer of a dead worker is None.
        """
        ...

    def end(self, worker: Any) -> None:
        """Kill a worker at once, whatever it is doing."""
        ...

    def close(self) -> None:
        """Release everything, once all workers have been killed."""
        ...


@dataclass
class _Task:
    job: Job
    attempts: int = 0


@dataclass
class _Slot:
    """Worker with its current task.

    Attributes:
        worker: handle of the backend.
        task: current task; None while the worker is idle.
        preparing: the worker builds what the task needs; the job itself follows.
        begun: monotonic time [s] of the last request.
    """

    worker: Any
    task: _Task | None = None
    preparing: bool = False
    begun: float = field(default_factory=time.monotonic)


class Dispatcher:
    """Executor over the workers of one backend.

    Args:
        backend: starts, feeds, polls and stops the workers.
        workers: largest number of workers.
        wall_seconds: time limit [s] of an episode or of a training round (`leg`); a slower worker counts as hung.
        build_seconds: time limit [s] of every other job.
    """

    def __init__(self, backend: WorkerBackend, workers: int, wall_seconds: float, build_seconds: float = BUILD_SECONDS):
        self.backend, self.workers = backend, workers
        self._limits: dict[str, float] = {"episode": wall_seconds, "train": wall_seconds}
        self._build_seconds = build_seconds
        self._slots: list[_Slot] = []

    def __enter__(self) -> Dispatcher:
        return self

    def __exit__(self, *_: object) -> None:
        self.stop_all()
        self.backend.close()

    def stop_all(self) -> None:
        """Kill all workers; the next job starts new ones."""
        for slot in self._slots:
            self.backend.end(slot.worker)
        self._slots.clear()

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """See `Executor`."""
        new, again = jobs if isinstance(jobs, deque) else deque(jobs), deque[_Task]()
        while new or again or any(slot.task for slot in self._slots):
            self._give_out(new, again)
            yield from self._take_in(again)

    def _give_out(self, new: deque[Job], again: deque[_Task]) -> None:
        """Assign jobs to idle workers, retries first."""
        for slot in self._slots:
            if (new or again) and slot.task is None:
                self._begin(slot, again.popleft() if again else _Task(new.popleft()))
        while (new or again) and len(self._slots) < self.workers:
            slot = _Slot(self.backend.spawn())
            self._slots.append(slot)
            self._begin(slot, again.popleft() if again else _Task(new.popleft()))

    def _begin(self, slot: _Slot, task: _Task) -> None:
        task.attempts += 1
        slot.task, slot.preparing, slot.begun = task, task.job["kind"] != "prepare", time.monotonic()
        self.backend.ask(slot.worker, {"kind": "prepare", "cell": task.job["cell"]} if slot.preparing else task.job)

    def _take_in(self, again: deque[_Task]) -> Iterator[Outcome]:
        busy = {id(slot.worker): slot for slot in self._slots if slot.task}
        soonest = min(slot.begun + self._limit(slot) for slot in busy.values()) - time.monotonic()
        answers = self.backend.poll([slot.worker for slot in busy.values()], max(0.0, soonest))
        for worker, answer in answers:
            slot = busy.pop(id(worker))
            if answer is None:
                yield from self._lost(slot, WORKER_DIED, again)
            elif slot.preparing and not ({"refused", "crash"} & set(answer)):
                slot.preparing, slot.begun = False, time.monotonic()
                assert slot.task
                self.backend.ask(worker, slot.task.job)
            else:
                task, slot.task = slot.task, None
                assert task
                yield Outcome(task.job, answer, "", time.monotonic() - slot.begun)
        for slot in busy.values():
            if time.monotonic() - slot.begun >= self._limit(slot):
                yield from self._lost(slot, HUNG, again)

    def _limit(self, slot: _Slot) -> float:
        assert slot.task
        kind = "prepare" if slot.preparing else slot.task.job["kind"]
        return self._limits.get(kind, self._build_seconds)

    def _lost(self, slot: _Slot, reason: str, again: deque[_Task]) -> Iterator[Outcome]:
        """Replace a worker; retry its job, or report it as lost."""
        self.backend.end(slot.worker)
        self._slots.remove(slot)
        task = slot.task
        assert task
        if task.attempts < ATTEMPTS:
            again.appendleft(task)
        else:
            yield Outcome(task.job, None, reason, time.monotonic() - slot.begun)
