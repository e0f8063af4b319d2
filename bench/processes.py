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

from .dispatch import Answer, Job
from .worker import one_thread

WORKER = (sys.executable, "-m", "onedemo.bench.worker")
CHUNK = 1 << 16


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
    """A crew of processes.

    Args:
        log: file that takes what they print; None: nothing does.
        command: starts one; None: `WORKER`.
    """

    def __init__(self, log: Path | None = None, command: Sequence[str] | None = None):
        self._log, self._command = log, command or WORKER

    def hire(self) -> Worker:
        """Start a process."""
        return Worker(self._command, self._log)

    def ask(self, worker: Worker, job: Job) -> None:
        """Send a job; that the process is dead shows when an answer is awaited."""
        pipe = worker.process.stdin
        assert pipe
        with suppress(BrokenPipeError):
            pipe.write(json.dumps(job).encode() + b"\n")
            pipe.flush()

    def heard(self, workers: Sequence[Worker], seconds: float) -> list[tuple[Any, Answer | None]]:
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
