"""Episode records as lines of a file that survives crashes: append, check sum, flush, fsync."""

from __future__ import annotations

import fcntl
import json
import os
import zlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import asdict, dataclass, fields
from pathlib import Path
from typing import Any

from ..planner.errors import OneDemoError

FILE = "episodes.jsonl"


class RunBusy(OneDemoError):
    """Another process writes into the run folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        super().__init__(f"{folder}: another run is writing here; wait for it, or choose another --output")


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """One finished episode.

    Attributes:
        cell: digest of the config of its cell, 12 hexadecimal digits.
        index: of the scenario.
        seed: of the scenario.
        method: the policy.
        task: the task.
        robot: the robot.
        level: the level.
        success: judged by the simulator at the end.
        safe: no unwanted contact at any time.
        stage: the furthest progress.
        failure_reason: "" or one of the task's FAILURES.
        detail: one line for the reader.
        collision: the last unwanted contact, "" if there was none.
        seconds: simulated.
        contacts: control steps in which the robot or an object touched an obstacle.
        clearance: smallest distance of the robot, or of what it held, to an obstacle [m]; None: there was none.
        refused: starts that were drawn and had no room for the obstacles.
        numbers: the task's own, as in `info`, each a list.
        metrics: see `metric_table`; None where there was nothing to measure.
        wall_seconds: real time; not part of the result.
        tick_us: median, 99th percentile and largest time of the policy per tick, and its time until the first action
            that moves something [us]; not part of the result.
    """

    cell: str
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
    metrics: dict[str, float | None]
    wall_seconds: float
    tick_us: list[float]

    @property
    def safe_success(self) -> bool:
        """Success without any unwanted contact."""
        return self.success and self.safe


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Hold the run folder for one process.

    Raises:
        RunBusy: another process holds it.
    """
    with (folder / ".lock").open("w") as file:
        try:
            fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise RunBusy(folder) from None
        yield


def encoded(record: EpisodeRecord) -> bytes:
    """One line: the record with a check sum."""
    body = json.dumps(asdict(record), sort_keys=True, separators=(",", ":"))
    return f'{{"crc":{zlib.crc32(body.encode())},"record":{body}}}\n'.encode()


def decoded(line: bytes) -> EpisodeRecord | None:
    """The record of a line; None if the line is not one, or is damaged."""
    try:
        outer: Any = json.loads(line)
        body, crc = outer["record"], outer["crc"]
        text = json.dumps(body, sort_keys=True, separators=(",", ":"))
        if zlib.crc32(text.encode()) != crc or set(body) != {field.name for field in fields(EpisodeRecord)}:
            return None
        return EpisodeRecord(**body)
    except (ValueError, TypeError, KeyError):
        return None


def read_records(path: Path) -> tuple[list[EpisodeRecord], list[int]]:
    """All records of a file, and the numbers (from 1) of lines that are none.

    A last line without its end is what a crash leaves behind: it is not counted as foreign.
    """
    if not path.exists():
        return [], []
    *lines, _torn = path.read_bytes().split(b"\n")
    records = [decoded(line) for line in lines]
    foreign = [number for number, record in enumerate(records, 1) if record is None]
    return [record for record in records if record is not None], foreign


class RecordWriter:
    """Appends records; a torn last line is cut off first, a failed write is taken back."""

    def __init__(self, path: Path):
        self._file = path.open("ab", buffering=0)
        self._end = path.read_bytes().rfind(b"\n") + 1
        self._file.truncate(self._end)

    def append(self, record: EpisodeRecord) -> None:
        """Write one line and wait until it is on the disk.

        Raises:
            OSError: the disk is full; the file ends with the last complete record.
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
