"""Main loop of a worker process: jobs arrive as lines of JSON, answers leave as lines of JSON.

The process dies with its parent however that ends, ignores Ctrl-C, which the parent handles, and computes with one
thread. All printed output goes to standard error and so into a log.
"""

from __future__ import annotations

import ctypes
import json
import logging
import os
import signal
import sys
import warnings
from typing import Protocol

from ..console import missing_library
from .dispatcher import Answer, Job

PR_SET_PDEATHSIG = 1
"""Option of Linux's prctl: signal to send when the parent dies."""
THREADS = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "NUMBA")
"""Libraries that would otherwise use all cores."""


class JobHandler(Protocol):
    """Handler that does jobs one after the other."""

    def do(self, job: Job) -> Answer:
        """Return the answer to a job."""
        ...

    def close(self) -> None:
        """Release everything."""
        ...


def one_thread() -> dict[str, str]:
    """Return the environment variables that restrict libraries to one thread."""
    return {f"{name}_NUM_THREADS": "1" for name in THREADS}


def die_with(parent: int) -> None:
    """Let the kernel kill this process, even a stopped one, when its parent ends."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def serve(handler: JobHandler, parent: int, output: int) -> None:
    """Answer jobs from standard input until it is closed.

    An exception is a bug in this project or in an installation; it is answered by {"crash": text}.

    Args:
        handler: does the jobs.
        parent: process id of the parent.
        output: file descriptor for the answers.
    """
    die_with(parent)
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    logging.basicConfig(level=logging.INFO, format="%(asctime)s %(process)d %(message)s")
    warnings.simplefilter("ignore")
    with os.fdopen(output, "w", encoding="utf-8") as answers:
        for line in sys.stdin:
            answers.write(json.dumps(answered(handler, json.loads(line))) + "\n")
            answers.flush()


def answered(handler: JobHandler, job: Job) -> Answer:
    """Return the answer to a job; exceptions become "crash", or "refused" for a missing library.

    Args:
        handler: does the job.
        job: the job.
    """
    try:
        return handler.do(job)
    except Exception as error:
        if library := missing_library(error):
            return {"refused": library, "key": ""}
        logging.getLogger("onedemo").info("%s", job.get("kind"), exc_info=True)
        return {"crash": f"{type(error).__name__}: {error}"}


def main(handler: JobHandler) -> None:
    """Run the worker process; its command-line arguments are the parent's id and the file descriptor for answers."""
    # output of libraries must not reach the user's terminal
    os.dup2(2, 1)
    serve(handler, int(sys.argv[1]), int(sys.argv[2]))
