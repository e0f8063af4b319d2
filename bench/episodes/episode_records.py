"""Episode records as lines of a file that survives crashes: append, check sum, flush, fsync."""

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

from ...planner.errors import OneDemoError
from ..workers.dispatcher import HUNG, WORKER_DIED

FILE = "episodes.jsonl"
FORMAT = 1
"""Of the lines of a file; a line of another one is foreign."""
TIMINGS = ("wall_seconds", "tick_us")
"""What is not part of the result: it differs from run to run."""


class RunBusy(OneDemoError):
    """Another process writes into the run folder."""

    def __init__(self, folder: Path):
        self.folder = folder
        super().__init__(f"{folder}: another run is writing here; wait for it, or choose another --output")


@dataclass(frozen=True, slots=True)
class EpisodeRecord:
    """One finished episode.

    Attributes:
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
        wall_seconds: real time; not part of the result.
        tick_us: median, 99th percentile and largest time of the policy per tick, and its time until the first action
            that moves something [us]; not part of the result. Zeros where the episode was lost with its worker.
        cell: digest of the cell's config.
        scenario: fingerprint of the scenario.
        metrics: see `metric_table`; None where there was nothing to measure.
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

    @property
    def key(self) -> tuple[str, int]:
        """What an episode is known by in a run: its cell and its scenario's index."""
        return self.cell, self.index

    @property
    def lost(self) -> bool:
        """Whether nobody knows how the episode would have ended, because its worker died or hung."""
        return self.failure_reason in (WORKER_DIED, HUNG) and self.seconds == 0.0

    @property
    def safe_success(self) -> bool:
        """Success without any unwanted contact."""
        return self.success and self.safe


def known_record(values: dict[str, Any]) -> EpisodeRecord:
    """The record of a mapping; keys that came later than the mapping have their default.

    Raises:
        ValueError: a key that no record has, or one that every record has is missing.
    """
    names = {each.name for each in fields(EpisodeRecord)}
    needed = {each.name for each in fields(EpisodeRecord) if each.default is each.default_factory is MISSING}
    if not needed <= set(values) <= names:
        raise ValueError(f"not the keys of a record: {sorted(set(values) ^ names)}")
    return EpisodeRecord(**values)


def result_of(record: EpisodeRecord) -> dict[str, Any]:
    """The record without what differs from run to run."""
    return {key: value for key, value in asdict(record).items() if key not in TIMINGS}


@contextmanager
def locked(folder: Path, part: str = "") -> Iterator[None]:
    """Hold the run folder for one process, or for one per part of it.

    Raises:
        RunBusy: another process holds it.
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
    """One line: the record with a check sum."""
    body = json.dumps(asdict(record), sort_keys=True, separators=(",", ":"))
    return f'{{"crc":{zlib.crc32(body.encode())},"format":{FORMAT},"record":{body}}}\n'.encode()


def decoded(line: bytes) -> EpisodeRecord | None:
    """The record of a line; None if the line is not one, or is damaged."""
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
    """Number (from 1) of every complete line of a file, and its record; None for one that is none.

    A last line without its end is what a crash leaves behind: it is none of them; see `torn_line`.
    """
    if not path.exists():
        return []
    *lines, _torn = path.read_bytes().split(b"\n")
    return [(number, decoded(line)) for number, line in enumerate(lines, 1)]


def read_records(path: Path) -> tuple[list[EpisodeRecord], list[int]]:
    """All records of a file, and the numbers (from 1) of lines that are none."""
    lines = read_lines(path)
    return [record for _, record in lines if record], [number for number, record in lines if record is None]


def torn_line(path: Path) -> int:
    """Number (from 1) of a last line that a crash tore; 0 if there is none."""
    if not path.exists():
        return 0
    *lines, torn = path.read_bytes().split(b"\n")
    return len(lines) + 1 if torn else 0


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
