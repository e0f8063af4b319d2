"""A worker process: jobs come in as lines of JSON, answers go out as lines of JSON.

It dies with its parent, whatever that dies of, ignores Ctrl-C, which is the parent's to hear, and computes with one
thread. What anything prints goes where standard error goes: into a log.
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
THREADS = ("OMP", "OPENBLAS", "MKL", "BLIS", "NUMEXPR", "NUMBA")
"""Libraries that would use all cores."""


class JobHandler(Protocol):
    """Does jobs one after the other."""

    def do(self, job: Job) -> Answer:
        """The answer to a job."""
        ...

    def close(self) -> None:
        """Leave nothing behind."""
        ...


def one_thread() -> dict[str, str]:
    """The environment variables that keep libraries at one thread."""
    return {f"{name}_NUM_THREADS": "1" for name in THREADS}


def die_with(parent: int) -> None:
    """Let the kernel end this process when its parent ends; a stopped process too."""
    ctypes.CDLL(None, use_errno=True).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)
    if os.getppid() != parent:
        os._exit(1)


def serve(handler: JobHandler, parent: int, output: int) -> None:
    """Answer jobs from standard input, until it is closed, into a file descriptor.

    An exception is a mistake in this project or in an installation: it is answered as {"crash": text}.
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
    """The answer to a job, whatever happens."""
    try:
        return handler.do(job)
    except Exception as error:
        if library := missing_library(error):
            return {"refused": library, "key": ""}
        logging.getLogger("onedemo").info("%s", job.get("kind"), exc_info=True)
        return {"crash": f"{type(error).__name__}: {error}"}


def main(handler: JobHandler) -> None:
    """Entry of the process; arguments: the parent's id, and where answers go."""
    # what libraries print must not end up in the user's terminal
    os.dup2(2, 1)
    serve(handler, int(sys.argv[1]), int(sys.argv[2]))
