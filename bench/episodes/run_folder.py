"""Files of a run folder, and locking of the folder.

| file | content |
|---|---|
| `config.yaml` | the config with the changes of the command line: `onedemo run` accepts it |
| `cells.json` | every cell: digest, label, whole config |
| `environment.json` | versions, processor and command of the run |
| `scenarios.json` | the frozen starts, see `scenarios.Suite` |
| `episodes.jsonl` | a line for each finished episode, appended; of part i of n: `episodes.i-of-n.jsonl` |
| `workers.log` | output of the worker processes |
| `trajectories/` | with `trajectories: true`: measurements of every tick, CELL-INDEX.npz, see `trace.Trace` |
| `showcase.json` | outcome of figure and video of the first episode of a run of one cell |
| `videos/`, `videos.json` | with `video: true`: failures, see `failure_selection.chosen`; reasons for missing videos |
"""

from __future__ import annotations

import errno
import fcntl
import json
import re
from collections.abc import Iterable, Iterator
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

from ...configs import BadConfig, Grid, RunConfig
from ..atomic_files import sha256_of, write_whole
from ..console import COMMAND_LINE
from .episode_records import FILE, EpisodeRecord, RunBusy, encoded, locked, read_lines, result_of, torn_line
from .scenarios import Suite, read_suite

CELLS, LOG = "cells.json", "workers.log"
SHOWN, FIGURE, VIDEO = "showcase.json", "episode0.png", "episode0.mp4"
VERSION = 1
NO_SPACE = (errno.ENOSPC, errno.EDQUOT)
PARTS = "episodes.*-of-*.jsonl"


class Shard(NamedTuple):
    """A part of a run: every `count`-th episode, beginning with the `index`-th (from 1)."""

    index: int
    count: int

    @property
    def name(self) -> str:
        """Name for files; "" for a whole run."""
        return "" if self.count == 1 else f"{self.index}-of-{self.count}"

    @property
    def file(self) -> str:
        """Name of the file of the part's records."""
        return f"episodes.{self.name}.jsonl" if self.name else FILE


WHOLE = Shard(1, 1)


def parsed_shard(text: str | None) -> Shard:
    """Return part i of n from a text like "2/4"; the whole run from None.

    Raises:
        BadConfig: the text has another form, or there is no such part.
    """
    if text is None:
        return WHOLE
    found = re.fullmatch(r"(\d{1,4})/(\d{1,4})", text)
    if not found or not 1 <= int(found[1]) <= int(found[2]):
        raise BadConfig(COMMAND_LINE, "--shard", f"{text!r} is not i/n with i from 1 to n, like 2/4")
    return Shard(int(found[1]), int(found[2]))


def open_folder(folder: Path, held: ExitStack, part: str = "") -> None:
    """Make the run folder and lock the folder, or a part of the run, for this process.

    Args:
        folder: run folder.
        held: releases the lock when it closes.
        part: name of the part; "": the whole folder.

    Raises:
        BadConfig: the folder cannot be written.
        RunBusy: another process writes there.
        OSError: the disk is full.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held.enter_context(locked(folder, part))
    except OSError as error:
        if error.errno in NO_SPACE:
            raise
        raise BadConfig(COMMAND_LINE, "--output", f"no run folder at {folder}: {error.strerror}") from None


@contextmanager
def alone(folder: Path, what: str) -> Iterator[None]:
    """Run the `with` block while no other process runs a block of the same name in this folder; wait if necessary.

    Args:
        folder: run folder.
        what: name of the block.
    """
    with (folder / f".lock-{what}").open("w") as file:
        fcntl.flock(file, fcntl.LOCK_EX)
        yield


def describe(grid: Grid, folder: Path, command: str) -> None:
    """Write the description of a run; refuse a folder that holds another run.

    Args:
        grid: cells of the run.
        folder: run folder.
        command: command line that started the run.

    Raises:
        BadConfig: the folder belongs to another config.
    """
    from io import StringIO

    from ruamel.yaml import YAML

    from ..provenance import fingerprint

    file, digest = folder / CELLS, grid.digest()
    if file.exists() and read_cells(folder)[0] != digest:
        raise BadConfig(file, "run", "the folder belongs to another config; choose another --output")
    cells = [
        {"digest": cell.digest(), "label": grid.label(cell), "config": cell.model_dump(mode="json")}
        for cell in grid.cells
    ]
    write_whole(file, json.dumps({"version": VERSION, "run": digest, "cells": cells}, indent=1) + "\n")
    text = StringIO()
    YAML(typ="safe", pure=True).dump(grid.written, text)
    write_whole(folder / "config.yaml", text.getvalue())
    made_on = {**fingerprint(), "command": command}
    write_whole(folder / "environment.json", json.dumps(made_on, indent=2) + "\n")


def read_cells(folder: Path) -> tuple[str, list[tuple[str, RunConfig]]]:
    """Return the digest of a run, and label and config of each of its cells.

    Raises:
        BadConfig: the file is missing, unreadable, or of another version.
    """
    file = folder / CELLS
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        if values["version"] != VERSION:
            raise BadConfig(file, "version", f"is {values['version']!r}; known: {VERSION}")
        return values["run"], [(each["label"], RunConfig.model_validate(each["config"])) for each in values["cells"]]
    except OSError as error:
        raise BadConfig(file, "", f"cannot be read: {error.strerror}; is this a run folder?") from None
    except (ValueError, TypeError, KeyError) as error:
        if isinstance(error, BadConfig):
            raise
        raise BadConfig(file, "", "is not a list of cells") from None


def recorded(
    folder: Path, cells: Iterable[RunConfig], suite: Suite
) -> tuple[dict[tuple[str, int], EpisodeRecord], list[str]]:
    """Return the finished episodes of a run, and notes about skipped lines.

    Args:
        folder: run folder.
        cells: cells of the run.
        suite: scenarios of the run; records of other scenarios are skipped.

    Returns:
        Records by cell digest and scenario index, and one line of text per skipped or torn line.
    """
    known = {
        (cell.digest(), each.index): suite.of(cell, each.index)["fingerprint"]
        for cell in cells
        for each in suite.feasible(cell)
    }
    records: dict[tuple[str, int], EpisodeRecord] = {}
    notes = []
    for file in [folder / FILE, *sorted(folder.glob(PARTS))]:
        for number, record in read_lines(file):
            if record is None:
                notes.append(f"{file}, line {number}: not an episode record, skipped")
            elif known.get(record.key) != record.scenario:
                notes.append(f"{file}, line {number}: an episode of another run, skipped")
            elif record.key not in records or records[record.key].lost:
                records[record.key] = record
        if number := torn_line(file):
            notes.append(f"{file}, line {number}: torn, its episode is run again")
    return records, notes


def merge(folder: Path, records: Iterable[EpisodeRecord], cells: list[RunConfig]) -> None:
    """Write the records of all parts, if there are any, into one file, in the order of the cells.

    The caller must hold the folder: no other process may append to that file meanwhile.

    Args:
        folder: run folder.
        records: all records of the run.
        cells: cells of the run.
    """
    if not any(folder.glob(PARTS)):
        return
    place = {cell.digest(): k for k, cell in enumerate(cells)}
    ordered = sorted(records, key=lambda record: (place[record.cell], record.index))
    with alone(folder, "merge"):
        write_whole(folder / FILE, b"".join(encoded(record) for record in ordered).decode())


def gather(folder: Path) -> None:
    """Merge the existing parts of a run, unless another process is writing to the merged file."""
    _, labeled = read_cells(folder)
    cells, suite = [cell for _, cell in labeled], read_suite(folder)
    if suite is not None and any(folder.glob(PARTS)):
        with suppress(RunBusy), locked(folder, "gather"):
            merge(folder, recorded(folder, cells, suite)[0].values(), cells)


def table_hash(records: Iterable[EpisodeRecord]) -> str:
    """Return the sha256 of all results but those of a real clock, independent of their order and of timings."""
    known = sorted((record for record in records if record.reproducible), key=lambda record: record.key)
    return sha256_of([result_of(record) for record in known])


def written_json(folder: Path, name: str) -> dict[str, Any]:
    """Return the content of a JSON file of the run folder; empty if the file is missing.

    Args:
        folder: run folder.
        name: file name.
    """
    file = folder / name
    return json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
