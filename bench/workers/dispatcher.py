"""Jobs given to workers that may die or hang.

A worker does one job at a time. If it dies, or takes too long, it is replaced and the job is given out once more; if
that ends the same way, the job is lost. Nothing else is: the other workers go on.
"""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple, Protocol

from ...planner.errors import OneDemoError

ERROR, WORKER_DIED, HUNG = "error", "worker_died", "timeout"
"""Reasons of failure that are not the task's: the policy raised an exception; the process that ran the episode died
twice; or it had to be ended twice, because the episode took too much real time."""
ATTEMPTS = 2
BUILD_SECONDS = 1200.0
"""Real time to compile the kernels, and to build a scene and a policy."""
Job = dict[str, Any]
Answer = dict[str, Any]


class WorkerFailed(OneDemoError):
    """A worker could not do its work, which is nobody's mistake in a config."""


class Outcome(NamedTuple):
    """What became of a job.

    Attributes:
        job: as it was given.
        answer: None if the job was lost.
        lost: "", `WORKER_DIED` or `HUNG`.
        seconds: real time of the last attempt.
    """

    job: Job
    answer: Answer | None
    lost: str
    seconds: float


class Executor(Protocol):
    """Runs jobs; used in a `with` statement, at whose end nothing of it is left."""

    workers: int

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """The outcomes, as they come. To a deque, jobs may be added while outcomes come; it is emptied."""
        ...

    def __enter__(self) -> Executor: ...

    def __exit__(self, *_: object) -> None: ...


class WorkerBackend(Protocol):
    """Start, feed, poll and stop workers of one kind."""

    def spawn(self) -> Any:
        """A new worker."""
        ...

    def ask(self, worker: Any, job: Job) -> None:
        """Give a job to an idle worker; if it is dead, `poll` says so."""
        ...

    def poll(self, workers: Sequence[Any], seconds: float) -> list[tuple[Any, Answer | None]]:
        """Those of the workers that have answered, or died (None), within some seconds; as soon as there is one."""
        ...

    def end(self, worker: Any) -> None:
        """End a worker at once, whatever it does."""
        ...

    def close(self) -> None:
        """Leave nothing behind, when all workers have been ended."""
        ...


@dataclass
class _Task:
    job: Job
    attempts: int = 0


@dataclass
class _Slot:
    """A worker and what it is busy with.

    Attributes:
        worker: the backend's handle of it.
        task: None while it is idle.
        preparing: it builds what the job needs; the job itself comes next.
        begun: when that was asked for.
    """

    worker: Any
    task: _Task | None = None
    preparing: bool = False
    begun: float = field(default_factory=time.monotonic)


class Dispatcher:
    """An executor over the workers of one backend.

    Args:
        backend: starts, feeds, polls and stops the workers.
        workers: how many at most.
        wall_seconds: real time of an episode, or of a leg of a training, after which its worker counts as hung.
        build_seconds: the same for everything else.
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
        """End all workers; the next job is for new ones."""
        for slot in self._slots:
            self.backend.end(slot.worker)
        self._slots.clear()

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """The outcomes, as they come."""
        new, again = jobs if isinstance(jobs, deque) else deque(jobs), deque[_Task]()
        while new or again or any(slot.task for slot in self._slots):
            self._give_out(new, again)
            yield from self._take_in(again)

    def _give_out(self, new: deque[Job], again: deque[_Task]) -> None:
        """Give jobs to idle workers, first those that were lost with one."""
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
        """Replace a worker; give its job out once more, or give it up."""
        self.backend.end(slot.worker)
        self._slots.remove(slot)
        task = slot.task
        assert task
        if task.attempts < ATTEMPTS:
            again.appendleft(task)
        else:
            yield Outcome(task.job, None, reason, time.monotonic() - slot.begun)
