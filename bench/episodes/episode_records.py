"""Episode records as lines of a crash-safe file: append, checksum, flush, fsync."""

from __future__ import annotations

import fcntl
import json
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import MISSING, asdict, dataclass, field, fields
from pathlib import Path
from typing import IO, Any

from ...configs.run_config import REAL, WAITS, first_method, present_method
from ...planner.errors import OneDemoError
from ..workers.dispatcher import HUNG, WORKER_DIED

FILE = "episodes.jsonl"
FORMAT = 1
"""Format version of a line; lines of other versions are not read."""
TIMINGS = ("wall_seconds", "tick_us", "calls", "slow_calls", "longest_ms", "held")
"""Fields that are not part of the result because they differ from run to run."""
LATER = {"clock": WAITS, "delay": 0}
"""Fields that are part of the result only if they have another value than this: earlier results keep their hash."""


class RunBusy(OneDemoError):
    """Another process writes into the run folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        super().__init__(f"{folder}: another run is writing here; wait for it, or choose another --output")


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """One finished episode.

    Attributes:
        index: index of the scenario.
        seed: seed of the scenario.
        method: name of the policy.
        task: name of the task.
        robot: name of the robot.
        level: level of difficulty.
        success: verdict of the simulator at the end.
        safe: True if there was no unwanted contact at any time.
        stage: furthest progress.
        failure_reason: "" or one of the task's FAILURES.
        detail: explanation in one line.
        collision: the last unwanted contact; "" if there was none.
        seconds: simulated duration [s].
        contacts: number of control steps in which the robot or an object touched an obstacle.
        clearance: smallest distance of the robot or the held object to an obstacle [m]; None without obstacles.
        refused: number of drawn starts that left no space for the obstacles and were drawn again.
        numbers: the task's own numbers, as in `info`, each as a list.
        wall_seconds: real time [s]; not part of the result.
        tick_us: median, 99th percentile and maximum of the policy's time per tick, and its total time until the first
            action that moves a joint [us]; not part of the result. Zeros if the episode was lost with its worker.
        cell: digest of the cell's config.
        scenario: fingerprint of the scenario.
        metrics: values by name, see `metric_table`; None if there was nothing to measure.
        clock: clock of the episode, see `RunConfig.clock`; with "real" the whole result depends on the machine.
        delay: number of control steps by which observations were late.
        calls: number of the policy's answers; 0 if unknown, in records of earlier versions and of lost episodes.
        slow_calls: number of those that took more than `world_clock.SLOW` of CPU time.
        longest_ms: longest CPU time of an answer [ms].
        held: number of control steps that passed while the policy had not answered yet.
    """

    index: int
    seed: int
    method: str
    task: str
    robot: str
    level: str
    success: bool
    safe: bool
    stage: str
    failure_reason: str
    detail: str
    collision: str
    seconds: float
    contacts: int
    clearance: float | None
    refused: int
    numbers: dict[str, list[float]]
    wall_seconds: float
    tick_us: list[float]
    cell: str = ""
    scenario: str = ""
    metrics: dict[str, float | None] = field(default_factory=dict)
    clock: str = WAITS
    delay: int = 0
    calls: int = 0
    slow_calls: int = 0
    longest_ms: float = 0.0
    held: int = 0

    @property
    def key(self) -> tuple[str, int]:
        """Identity of the episode in its run: digest of the cell and index of the scenario."""
        return self.cell, self.index

    @property
    def lost(self) -> bool:
        """True if the outcome is unknown because the worker died or hung."""
        return self.failure_reason in (WORKER_DIED, HUNG) and self.seconds == 0.0

    @property
    def reproducible(self) -> bool:
        """True unless the world went on while the policy computed: only these results have a hash."""
        return self.clock != REAL

    @property
    def safe_success(self) -> bool:
        """True for a success without any unwanted contact."""
        return self.success and self.safe


def known_record(values: dict[str, Any]) -> EpisodeRecord:
    """Return the record of a mapping; fields added after the mapping was written get their defaults.

    Raises:
        ValueError: a key is unknown, or a key without default is missing.
    """
    names = {each.name for each in fields(EpisodeRecord)}
    needed = {each.name for each in fields(EpisodeRecord) if each.default is each.default_factory is MISSING}
    if not needed <= set(values) <= names:
        raise ValueError(f"not the keys of a record: {sorted(set(values) ^ names)}")
    return EpisodeRecord(**{**values, "method": present_method(str(values["method"]))})


def result_of(record: EpisodeRecord) -> dict[str, Any]:
    """Return the fields of a record that do not differ from run to run."""
    left_out = (*TIMINGS, *(key for key, default in LATER.items() if getattr(record, key) == default))
    values = {key: value for key, value in asdict(record).items() if key not in left_out}
    return {**values, "method": first_method(record.method)}


@contextmanager
def locked(folder: Path, part: str = "") -> Iterator[None]:
    """Lock the run folder for this process, exclusively or for one part of the run.

    Args:
        folder: run folder.
        part: name of the part; processes with different parts may hold the folder together; "": the whole folder.

    Raises:
        RunBusy: another process holds the folder or the part.
    """
    with (folder / ".lock").open("w") as whole:
        _hold(whole, folder, shared=bool(part))
        if not part:
            yield
            return
        with (folder / f".lock-{part}").open("w") as own:
            _hold(own, folder, shared=False)
            yield


def _hold(file: IO[str], folder: Path, *, shared: bool) -> None:
    try:
        fcntl.flock(file, (fcntl.LOCK_SH if shared else fcntl.LOCK_EX) | fcntl.LOCK_NB)
    except BlockingIOError:
        raise RunBusy(folder) from None


def encoded(record: EpisodeRecord) -> bytes:
    """Return the line of a record, with checksum."""
    body = json.dumps(asdict(record), sort_keys=True, separators=(",", ":"))
    return f'{{"crc":{zlib.crc32(body.encode())},"format":{FORMAT},"record":{body}}}\n'.encode()


def decoded(line: bytes) -> EpisodeRecord | None:
    """Return the record of a line; None if the line is foreign or damaged."""
    try:
        outer: Any = json.loads(line)
        body, crc = outer["record"], outer["crc"]
        text = json.dumps(body, sort_keys=True, separators=(",", ":"))
        if outer["format"] != FORMAT or zlib.crc32(text.encode()) != crc:
            return None
        return known_record(body)
    except (ValueError, TypeError, KeyError):
        return None


def read_lines(path: Path) -> list[tuple[int, EpisodeRecord | None]]:
    """Return the number (from 1) and the record of every complete line; None for a line without a valid record.

    An incomplete last line, left by a crash, is omitted; see `torn_line`.
    """
    if not path.exists():
        return []
    *lines, _torn = path.read_bytes().split(b"\n")
    return [(number, decoded(line)) for number, line in enumerate(lines, 1)]


def read_records(path: Path) -> tuple[list[EpisodeRecord], list[int]]:
    """Return all valid records of a file, and the numbers (from 1) of its invalid lines."""
    lines = read_lines(path)
    return [record for _, record in lines if record], [number for number, record in lines if record is None]


def torn_line(path: Path) -> int:
    """Return the number (from 1) of a last line torn by a crash; 0 if there is none."""
    if not path.exists():
        return 0
    *lines, torn = path.read_bytes().split(b"\n")
    return len(lines) + 1 if torn else 0


class RecordWriter:
    """Writer that appends records: it first cuts off a torn last line, and undoes a failed write."""

    def __init__(self, path: Path):
        self._file = path.open("ab", buffering=0)
        self._end = path.read_bytes().rfind(b"\n") + 1
        self._file.truncate(self._end)

    def append(self, record: EpisodeRecord) -> None:
        """Append one record and wait until it is on disk.

        Raises:
            OSError: writing failed, for example on a full disk; the file ends with the last complete record.
        """
        line = encoded(record)
        try:
            rest = memoryview(line)
            while rest:
                rest = rest[self._file.write(rest) :]
            os.fsync(self._file.fileno())
        except OSError:
            self._file.truncate(self._end)
            raise
        self._end += len(line)

    def close(self) -> None:
        """Close the file."""
        self._file.close()
