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

from .records import HUNG, WORKER_DIED

ATTEMPTS = 2
BUILD_SECONDS = 1200.0
"""Real time to compile the kernels, and to build a scene and a policy."""
Job = dict[str, Any]
Answer = dict[str, Any]


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


class Crew(Protocol):
    """How workers of some kind are had, asked, heard and ended."""

    def hire(self) -> Any:
        """A new worker."""
        ...

    def ask(self, worker: Any, job: Job) -> None:
        """Give a job to an idle worker; if it is dead, `heard` says so."""
        ...

    def heard(self, workers: Sequence[Any], seconds: float) -> list[tuple[Any, Answer | None]]:
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
class _Desk:
    """A worker and what it is busy with.

    Attributes:
        worker: the crew's.
        task: None while it is idle.
        preparing: it builds what the job needs; the job itself comes next.
        begun: when that was asked for.
    """

    worker: Any
    task: _Task | None = None
    preparing: bool = False
    begun: float = field(default_factory=time.monotonic)


class Dispatcher:
    """An executor over a crew.

    Args:
        crew: of what kind the workers are.
        workers: how many at most.
        wall_seconds: real time of an episode, or of a leg of a training, after which its worker counts as hung.
        build_seconds: the same for everything else.
    """

    def __init__(self, crew: Crew, workers: int, wall_seconds: float, build_seconds: float = BUILD_SECONDS):
        self.crew, self.workers = crew, workers
        self._limits: dict[str, float] = {"episode": wall_seconds, "train": wall_seconds}
        self._build_seconds = build_seconds
        self._desks: list[_Desk] = []

    def __enter__(self) -> Dispatcher:
        return self

    def __exit__(self, *_: object) -> None:
        self.dismiss()
        self.crew.close()

    def dismiss(self) -> None:
        """End all workers; the next job is for new ones."""
        for desk in self._desks:
            self.crew.end(desk.worker)
        self._desks.clear()

    def results(self, jobs: Sequence[Job]) -> Iterator[Outcome]:
        """The outcomes, as they come."""
        new, again = jobs if isinstance(jobs, deque) else deque(jobs), deque[_Task]()
        while new or again or any(desk.task for desk in self._desks):
            self._give_out(new, again)
            yield from self._take_in(again)

    def _give_out(self, new: deque[Job], again: deque[_Task]) -> None:
        """Give jobs to idle workers, first those that were lost with one."""
        for desk in self._desks:
            if (new or again) and desk.task is None:
                self._begin(desk, again.popleft() if again else _Task(new.popleft()))
        while (new or again) and len(self._desks) < self.workers:
            desk = _Desk(self.crew.hire())
            self._desks.append(desk)
            self._begin(desk, again.popleft() if again else _Task(new.popleft()))

    def _begin(self, desk: _Desk, task: _Task) -> None:
        task.attempts += 1
        desk.task, desk.preparing, desk.begun = task, task.job["kind"] != "prepare", time.monotonic()
        self.crew.ask(desk.worker, {"kind": "prepare", "cell": task.job["cell"]} if desk.preparing else task.job)

    def _take_in(self, again: deque[_Task]) -> Iterator[Outcome]:
        busy = {id(desk.worker): desk for desk in self._desks if desk.task}
        soonest = min(desk.begun + self._limit(desk) for desk in busy.values()) - time.monotonic()
        answers = self.crew.heard([desk.worker for desk in busy.values()], max(0.0, soonest))
        for worker, answer in answers:
            desk = busy.pop(id(worker))
            if answer is None:
                yield from self._lost(desk, WORKER_DIED, again)
            elif desk.preparing and not ({"refused", "crash"} & set(answer)):
                desk.preparing, desk.begun = False, time.monotonic()
                assert desk.task
                self.crew.ask(worker, desk.task.job)
            else:
                task, desk.task = desk.task, None
                assert task
                yield Outcome(task.job, answer, "", time.monotonic() - desk.begun)
        for desk in busy.values():
            if time.monotonic() - desk.begun >= self._limit(desk):
                yield from self._lost(desk, HUNG, again)

    def _limit(self, desk: _Desk) -> float:
        assert desk.task
        kind = "prepare" if desk.preparing else desk.task.job["kind"]
        return self._limits.get(kind, self._build_seconds)

    def _lost(self, desk: _Desk, reason: str, again: deque[_Task]) -> Iterator[Outcome]:
        """Replace a worker; give its job out once more, or give it up."""
        self.crew.end(desk.worker)
        self._desks.remove(desk)
        task = desk.task
        assert task
        if task.attempts < ATTEMPTS:
            again.appendleft(task)
        else:
            yield Outcome(task.job, None, reason, time.monotonic() - desk.begun)
