"""Workers as actors of Ray, on this machine or on a cluster: each keeps its environments.

Ray's dashboard and its job port let whoever reaches them run code: a local cluster has no dashboard and listens on
the loopback address; a cluster's address is used only if the user gives one.
"""

from __future__ import annotations

import os
import re
import signal
import socket
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from ...planner.errors import BadConfig
from .dispatcher import Answer, Job
from .worker_process import JobHandler, answered, one_thread

LOOPBACK = "127.0.0.1"
FORM = re.compile(r"(?:ray://)?(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[^\s:/\[\]]+)):(?P<port>\d{1,5})")
FOUND_BY_RAY = ("auto", "local")
"""Addresses that name no machine: Ray itself looks for a cluster on this one."""
PATIENCE = 5.0
"""Seconds in which a cluster must answer: Ray would ask for minutes."""


class Actor:
    """A handler of jobs in a process of Ray's."""

    def __init__(self, handler: type[JobHandler]):
        self._handler = handler()

    def process(self) -> int:
        """Its id."""
        return os.getpid()

    def do(self, job: Job) -> Answer:
        """The answer to a job, whatever happens."""
        return answered(self._handler, job)


@dataclass(eq=False)
class ActorWorker:
    """An actor.

    Attributes:
        actor: Ray's handle.
        process: a promise of its process's id.
        answer: a promise of the answer to its job.
    """

    actor: Any
    process: Any
    answer: Any = None


class RayActors:
    """Workers that are actors.

    Args:
        address: of a cluster; None: one is started on this machine, and ended with the run.
        workers: processor cores of a cluster that is started.
        handler: does the jobs in them.
        log: file that takes why actors died; None: nothing does.

    Raises:
        BadConfig: Ray is not installed, the address is none, or there is no such cluster.
    """

    def __init__(self, address: str | None, workers: int, handler: type[JobHandler], log: Path | None = None):
        self._ray, self._local, self._handler, self._log = _imported(), address is None, handler, log
        options: dict[str, Any] = {"address": address}
        if address is not None:
            check_reachable(address)
        if self._local:
            options = {"num_cpus": workers, "num_gpus": 0, "include_dashboard": False, "_node_ip_address": LOOPBACK}
        options |= {"log_to_driver": False, "logging_level": "ERROR", "runtime_env": {"env_vars": one_thread()}}
        try:
            self._ray.init(**options)
        except (ConnectionError, ValueError, RuntimeError) as error:
            reason = str(error).splitlines()[0]
            raise BadConfig("Ray", "address", f"no cluster at {address or 'this machine'}: {reason}") from None
        self._actor = self._ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(Actor)

    def spawn(self) -> ActorWorker:
        """Start an actor."""
        actor = self._actor.remote(self._handler)
        return ActorWorker(actor, actor.process.remote())

    def ask(self, worker: ActorWorker, job: Job) -> None:
        """Send a job."""
        worker.answer = worker.actor.do.remote(job)

    def poll(self, workers: Sequence[ActorWorker], seconds: float) -> list[tuple[Any, Answer | None]]:
        """The workers that have answered or died, within some seconds."""
        promises = {worker.answer: worker for worker in workers}
        ready, _ = self._ray.wait(list(promises), num_returns=1, timeout=seconds)
        return [(promises[promise], self._answer(promise)) for promise in ready]

    def end(self, worker: ActorWorker) -> None:
        """Kill an actor; on this machine its process too, which hears nothing while it is stopped."""
        process = None
        if self._local:
            with suppress(self._ray.exceptions.RayError):
                process = self._ray.get(worker.process, timeout=0)
        self._ray.kill(worker.actor, no_restart=True)
        if process is not None:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def close(self) -> None:
        """Leave the cluster; one that was started here is ended."""
        self._ray.shutdown()

    def _answer(self, promise: Any) -> Answer | None:
        try:
            return self._ray.get(promise)
        except self._ray.exceptions.RayError as error:
            if self._log:
                with self._log.open("a", encoding="utf-8") as file:
                    file.write(f"{error}\n")
            return None


def check_reachable(address: str, seconds: float = PATIENCE) -> None:
    """Refuse an address at which nothing listens.

    Args:
        address: as `ray.init` takes it.
        seconds: to wait for an answer of each of the machine's addresses.

    Raises:
        BadConfig: it is not of a form that Ray knows, or nobody answers.
    """
    if address in FOUND_BY_RAY:
        return
    found = FORM.fullmatch(address)
    if not found or not 0 < int(found["port"]) < 2**16:
        reason = f"{address!r} is not ray://HOST:PORT, HOST:PORT, {' or '.join(FOUND_BY_RAY)}"
        raise BadConfig("Ray", "address", reason)
    try:
        socket.create_connection((found["six"] or found["name"], int(found["port"])), seconds).close()
    except (OSError, UnicodeError) as error:
        reason = getattr(error, "strerror", None) or str(error) or type(error).__name__
        raise BadConfig("Ray", "address", f"no cluster at {address}: {reason}") from None


def _imported() -> Any:
    try:
        return import_module("ray")
    except ImportError:
        raise BadConfig("Ray", "executor", "is not installed: pip install 'onedemo[ray]'") from None
