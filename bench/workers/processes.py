"""Workers as separate processes, each behind two pipes.

A standard process pool breaks as a whole when one of its processes dies, and cannot kill one that hangs.
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
"""Largest number of bytes read from a pipe at once."""


def command_of(handler: type[JobHandler]) -> tuple[str, ...]:
    """Return the command of a worker process: the handler's module, which serves jobs when it is run."""
    return (sys.executable, "-m", handler.__module__)


class Worker:
    """Running worker process.

    Attributes:
        process: handle of the process.
        answers: file descriptor from which its answers are read.
        read: bytes received so far of the next answer.
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
                    # PYTHONSAFEPATH: no imports from the user's current folder
                    env={**os.environ, **one_thread(), "PYTHONSAFEPATH": "1"},
                )
            finally:
                os.close(other)

    def take(self) -> tuple[bool, Answer | None]:
        """Read the available bytes.

        Returns:
            Whether an answer is complete or the process has died, and the answer; None if it has died.
        """
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
    """Backend of worker processes.

    Args:
        command: command that starts a worker; see `command_of`.
        log: file for the output of the workers; None: it is discarded.
    """

    def __init__(self, command: Sequence[str], log: Path | None = None):
        self._command, self._log = command, log

    def spawn(self) -> Worker:
        """See `WorkerBackend`."""
        return Worker(self._command, self._log)

    def ask(self, worker: Worker, job: Job) -> None:
        """See `WorkerBackend`."""
        pipe = worker.process.stdin
        assert pipe
        with suppress(BrokenPipeError):
            pipe.write(json.dumps(job).encode() + b"\n")
            pipe.flush()

    def poll(self, workers: Sequence[Worker], seconds: float) -> list[tuple[Any, Answer | None]]:
        """See `WorkerBackend`."""
        pipes = {worker.answers: worker for worker in workers}
        # poll, unlike select, has no limit on the number or value of descriptors
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
        """See `WorkerBackend`; waits until the process is gone. Stopped processes are killed, too."""
        worker.process.kill()
        worker.process.wait()
        os.close(worker.answers)
        if worker.process.stdin:
            with suppress(BrokenPipeError):
                worker.process.stdin.close()

    def close(self) -> None:
        """See `WorkerBackend`."""
