"""Workers as processes of their own, each behind two pipes.

A stock pool breaks as a whole when one of its processes dies, and cannot end one that hangs.
"""

from __future__ import annotations

import json
import os
import select
import subprocess
import sys
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

from .dispatcher import Answer, Job
from .worker_process import JobHandler, one_thread

CHUNK = 1 << 16


def command_of(handler: type[JobHandler]) -> tuple[str, ...]:
    """The command of a worker process: the module of its handler, which serves jobs when it is run."""
    return (sys.executable, "-m", handler.__module__)


class Worker:
    """A running process.

    Attributes:
        process: it.
        answers: file descriptor that its answers come from.
        read: what has come of the next answer.
    """

    def __init__(self, command: Sequence[str], log: Path | None):
        self.answers, other = os.pipe()
        self.read = b""
        with open(log or os.devnull, "ab") as errors:
            try:
                self.process = subprocess.Popen(
                    [*command, str(os.getpid()), str(other)],
                    stdin=subprocess.PIPE,
                    stdout=subprocess.DEVNULL,
                    stderr=errors,
                    pass_fds=(other,),
                    # nothing is imported from the folder that the user happens to be in
                    env={**os.environ, **one_thread(), "PYTHONSAFEPATH": "1"},
                )
            finally:
                os.close(other)

    def take(self) -> tuple[bool, Answer | None]:
        """Read what is there: whether that made an answer, or the end (None), of it."""
        data = os.read(self.answers, CHUNK)
        if not data:
            return True, None
        self.read += data
        line, ended, rest = self.read.partition(b"\n")
        if not ended:
            return False, None
        self.read = rest
        return True, json.loads(line)


class Processes:
    """Worker processes.

    Args:
        command: what starts one; see `command_of`.
        log: file that takes what they print; None: nothing does.
    """

    def __init__(self, command: Sequence[str], log: Path | None = None):
        self._command, self._log = command, log

    def spawn(self) -> Worker:
        """Start a process."""
        return Worker(self._command, self._log)

    def ask(self, worker: Worker, job: Job) -> None:
        """Send a job; that the process is dead shows when an answer is awaited."""
        pipe = worker.process.stdin
        assert pipe
        with suppress(BrokenPipeError):
            pipe.write(json.dumps(job).encode() + b"\n")
            pipe.flush()

    def poll(self, workers: Sequence[Worker], seconds: float) -> list[tuple[Any, Answer | None]]:
        """The workers that have answered or died, within some seconds."""
        pipes = {worker.answers: worker for worker in workers}
        # poll, unlike select, takes any number of descriptors of any size
        poll = select.poll()
        for pipe in pipes:
            poll.register(pipe, select.POLLIN | select.POLLHUP)
        found = []
        for pipe, _ in poll.poll(1e3 * seconds):
            whole, answer = pipes[pipe].take()
            if whole:
                found.append((pipes[pipe], answer))
        return found

    def end(self, worker: Worker) -> None:
        """Kill a process, also a stopped one, and wait until it is gone."""
        worker.process.kill()
        worker.process.wait()
        os.close(worker.answers)
        if worker.process.stdin:
            with suppress(BrokenPipeError):
                worker.process.stdin.close()

    def close(self) -> None:
        """Nothing is left."""
