"""Reading of run folders for a report: configs, environment, and every episode. Nothing is run here."""

from __future__ import annotations

from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig, RunConfig
from ...planner.strict_json import Refused, parsed
from ..episodes.episode_records import EpisodeRecord, result_of
from ..episodes.run_folder import read_cells, recorded
from ..episodes.scenarios import FILE as SCENARIOS
from ..episodes.scenarios import Suite, check_mergeable, read_suite

MAX_BYTES = 64 * 2**20
"""Largest size of the file that describes the machine [bytes]."""
MOST_NOTES = 10
"""Number of notes about damaged files that are listed one by one."""


@dataclass(frozen=True, slots=True)
class Run:
    """One run folder, or several merged run folders.

    Attributes:
        folders: run folders; paths in a report are relative to the first.
        cells: configs of the cells by digest, in the order of the run.
        labels: label of each cell by digest.
        records: episodes of each cell by digest, in the order of their indices.
        suite: the scenarios.
        environment: see `provenance.fingerprint`.
        command: command line of the run; "" if unknown.
        warnings: notes for the reader about the files.
    """

    folders: tuple[Path, ...]
    cells: dict[str, RunConfig]
    labels: dict[str, str]
    records: dict[str, list[EpisodeRecord]]
    suite: Suite
    environment: dict[str, Any]
    command: str
    warnings: tuple[str, ...]

    def planned(self, digest: str) -> int:
        """Return the number of feasible episodes of a cell: one for each scenario that could be drawn."""
        return len(self.suite.feasible(self.cells[digest]))

    @property
    def every(self) -> list[EpisodeRecord]:
        """Episodes of all cells."""
        return [record for found in self.records.values() for record in found]


def read_run(folder: Path) -> Run:
    """Return a run folder, finished or not, merged or in parts.

    Raises:
        BadConfig: the folder cannot be used; the error names file, key and reason.
    """
    if not folder.is_dir():
        raise BadConfig(folder, "", "is not a run folder: there is no such folder")
    labeled = [(cell.digest(), label, cell) for label, cell in read_cells(folder)[1]]
    suite = read_suite(folder)
    if suite is None:
        raise BadConfig(folder, SCENARIOS, "is missing: the run has not begun")
    cells = {digest: cell for digest, _, cell in labeled}
    if not cells:
        raise BadConfig(folder / "cells.json", "cells", "is empty")
    try:
        known, notes = recorded(folder, cells.values(), suite)
    except (KeyError, TypeError):
        raise BadConfig(folder / SCENARIOS, "scenarios", "are not those of the cells") from None
    sound = [known[key] for key in sorted(known) if _is_sound(known[key])]
    environment = _environment(folder / "environment.json")
    return Run(
        folders=(folder,),
        cells=cells,
        labels={digest: label for digest, label, _ in labeled},
        records={digest: [record for record in sound if record.cell == digest] for digest in cells},
        suite=suite,
        environment=environment,
        command=str(environment.get("command", "")),
        warnings=_warnings(folder, notes, len(known) - len(sound)),
    )


def merged(runs: list[Run]) -> Run:
    """Return several runs as one; if an episode is in several runs, the first run counts.

    Raises:
        BadConfig: the runs have different scenarios.
    """
    first = runs[0]
    if len(runs) == 1:
        return first
    check_mergeable({run.folders[0]: run.suite for run in runs})
    cells, labels, warnings = dict(first.cells), dict(first.labels), list(first.warnings)
    records = {digest: {r.index: r for r in found} for digest, found in first.records.items()}
    for run in runs[1:]:
        cells, labels = {**run.cells, **cells}, {**run.labels, **labels}
        warnings += run.warnings
        for digest, found in run.records.items():
            known = records.setdefault(digest, {})
            twice = [r for r in found if r.index in known and r.reproducible]
            differing = sum(result_of(r) != result_of(known[r.index]) for r in twice)
            if differing:
                warnings.append(f"{run.folders[0]}: {differing} episodes of cell {digest} ended differently before")
            records[digest] = {**{r.index: r for r in found}, **known}
    return Run(
        folders=tuple(folder for run in runs for folder in run.folders),
        cells=cells,
        labels=labels,
        records={digest: [found[index] for index in sorted(found)] for digest, found in records.items()},
        suite=first.suite,
        environment=first.environment,
        command="",
        warnings=tuple(warnings),
    )


def _environment(path: Path) -> dict[str, Any]:
    try:
        found = parsed(path, MAX_BYTES)
    except Refused as refused:
        raise BadConfig(path, "" if refused.key == "file" else refused.key, refused.reason) from None
    if not isinstance(found, dict):
        raise BadConfig(path, "", "does not hold a table")
    return found


def _warnings(folder: Path, notes: list[str], unsound: int) -> tuple[str, ...]:
    """Return notes about skipped lines and records, without the folder's path."""
    said = [note.removeprefix(f"{folder}/") for note in notes[:MOST_NOTES]]
    if len(notes) > MOST_NOTES:
        said.append(f"{len(notes) - MOST_NOTES} more lines were passed over")
    if unsound:
        said.append(f"{unsound} records hold values of other types and were passed over")
    return tuple(said)


def _is_sound(record: EpisodeRecord) -> bool:
    """Return whether all fields have their declared types."""
    number = (int, float)
    return (
        all(isinstance(getattr(record, name), str) for name in _WORDS)
        and all(isinstance(getattr(record, name), int) for name in _COUNTS)
        and isinstance(record.seconds, number)
        and isinstance(record.longest_ms, number)
        and isinstance(record.wall_seconds, number)
        and isinstance(record.metrics, dict)
        and all(value is None or isinstance(value, number) for value in record.metrics.values())
        and isinstance(record.tick_us, list)
        and len(record.tick_us) >= 3
        and all(isinstance(value, number) for value in record.tick_us)
    )


_COUNTS = [field.name for field in fields(EpisodeRecord) if field.type == "int"]
_WORDS = [field.name for field in fields(EpisodeRecord) if field.type == "str"]


def speeds_of(suite: Suite) -> dict[str, float]:
    """Return the largest obstacle speed [m/s] of each scenario with obstacles by its fingerprint; 0: all are static."""
    found = {}
    for scenario in suite.scenarios:
        start = scenario.get("start")
        obstacles = start.get("obstacles") if isinstance(start, dict) else None
        if isinstance(obstacles, list) and obstacles:
            found[scenario["fingerprint"]] = max(peak_speed(obstacle) for obstacle in obstacles)
    return found


def peak_speed(obstacle: Any) -> float:
    """Return the largest speed [m/s] of an obstacle as described by `start_states.obstacle`; 0 if it is static."""
    if not isinstance(obstacle, dict):
        return 0.0
    try:
        frequency = float(obstacle.get("frequency", 0.0))
        axes = [np.linalg.norm(np.asarray(obstacle.get(key, (0.0,)), dtype=np.float64)) for key in ("long", "short")]
    except (TypeError, ValueError):
        return 0.0
    speed = abs(frequency) * float(max(axes))
    return speed if np.isfinite(speed) else 0.0
