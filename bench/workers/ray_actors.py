"""Workers as Ray actors, on this machine or on a cluster; each keeps its environments.

Ray's dashboard and job port let anyone who reaches them run code: a local cluster therefore has no dashboard and
listens on the loopback address, and a remote cluster is used only if the user gives its address.
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

from ...configs import BadConfig
from .dispatcher import Answer, Job
from .worker_process import JobHandler, answered, one_thread

LOOPBACK = "127.0.0.1"
FORM = re.compile(r"(?:ray://)?(?:\[(?P<six>[0-9a-fA-F:.]+)\]|(?P<name>[^\s:/\[\]]+)):(?P<port>\d{1,5})")
"""Form of a cluster's address: [ray://]HOST:PORT."""
FOUND_BY_RAY = ("auto", "local")
"""Addresses that name no machine: Ray itself looks for a cluster on this one."""
PATIENCE = 5.0
"""Time [s] in which a cluster must answer; Ray itself would try for minutes."""


class RemoteHandler:
    """Job handler in a Ray process."""

    def __init__(self, handler: type[JobHandler]):
        self._handler = handler()

    def process(self) -> int:
        """Return the process id."""
        return os.getpid()

    def do(self, job: Job) -> Answer:
        """Return the answer to a job; never raises."""
        return answered(self._handler, job)


@dataclass(eq=False)
class ActorWorker:
    """Running Ray actor.

    Attributes:
        actor: Ray's handle of the actor.
        process: future of its process id.
        answer: future of the answer to its job.
    """

    actor: Any
    process: Any
    answer: Any = None


class RayActors:
    """Backend of Ray actors.

    Args:
        address: address of a cluster; None: a cluster is started on this machine and stopped with the run.
        workers: processor cores of a cluster started here.
        handler: class that does the jobs.
        log: file for the reasons why actors died; None: they are discarded.

    Raises:
        BadConfig: Ray is not installed, the address is malformed, or no cluster answers.
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
        self._actor = self._ray.remote(num_cpus=1, max_restarts=0, max_task_retries=0)(RemoteHandler)

    def spawn(self) -> ActorWorker:
        """See `WorkerBackend`."""
        actor = self._actor.remote(self._handler)
        return ActorWorker(actor, actor.process.remote())

    def ask(self, worker: ActorWorker, job: Job) -> None:
        """See `WorkerBackend`."""
        worker.answer = worker.actor.do.remote(job)

    def poll(self, workers: Sequence[ActorWorker], seconds: float) -> list[tuple[Any, Answer | None]]:
        """See `WorkerBackend`."""
        promises = {worker.answer: worker for worker in workers}
        ready, _ = self._ray.wait(list(promises), num_returns=1, timeout=seconds)
        return [(promises[promise], self._answer(promise)) for promise in ready]

    def end(self, worker: ActorWorker) -> None:
        """See `WorkerBackend`; on this machine the process is killed, too, since a stopped one ignores Ray."""
        process = None
        if self._local:
            with suppress(self._ray.exceptions.RayError):
                process = self._ray.get(worker.process, timeout=0)
        self._ray.kill(worker.actor, no_restart=True)
        if process is not None:
            with suppress(ProcessLookupError):
                os.kill(process, signal.SIGKILL)

    def close(self) -> None:
        """Leave the cluster; one that was started here is stopped."""
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
        address: address as `ray.init` takes it.
        seconds: timeout [s] for each address that the host name resolves to.

    Raises:
        BadConfig: the form of the address is unknown to Ray, or no host answers.
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
