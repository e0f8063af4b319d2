"""Run folders as a report reads them: what was asked for, on what it ran, and every episode. Nothing is run here."""

from __future__ import annotations

import hashlib
import json
import re
from collections.abc import Iterable
from dataclasses import dataclass, fields
from pathlib import Path
from typing import Any

import numpy as np

from ..configs.loader import load_mapping
from ..planner.errors import BadConfig
from ..planner.strict_json import Refused, parsed
from .records import FILE, EpisodeRecord, read_records

MAX_BYTES = 512 * 2**20
"""Of a JSON file."""
DIGEST = re.compile(r"[0-9a-f]{12}")
CONFIG_KEYS = {"name": str, "task": str, "method": str, "robot": str, "level": str, "episodes": int}
TIMINGS = ("wall_seconds", "tick_us")
"""Fields of a record that are no part of the result."""
Key = tuple[str, str, str, int]
"""Task, robot, level and seed of a scenario."""


@dataclass(frozen=True, slots=True)
class Cell:
    """One method on one task, robot and level.

    Attributes:
        digest: of its config, 12 hexadecimal digits.
        name: of the run.
        task: what was done.
        method: by whom.
        robot: with what.
        level: how far from the demonstration.
        planned: episodes that the config asks for.
        settings: of the method, as far as they are not its defaults.
    """

    digest: str
    name: str
    task: str
    method: str
    robot: str
    level: str
    planned: int
    settings: dict[str, Any]


@dataclass(frozen=True, slots=True)
class Run:
    """One run folder, or several that were merged.

    Attributes:
        folders: where it is; the first is what paths in a report are relative to.
        cells: in the order of the run.
        records: of each cell by digest, by index.
        scenarios: hash of the scenarios.
        speeds: of each scenario that had obstacles the largest speed of any [m/s], 0: all stood still.
        environment: see `environment.fingerprint`.
        command: what started it, "" if it is not known.
        warnings: what a reader should know about the files.
    """

    folders: tuple[Path, ...]
    cells: tuple[Cell, ...]
    records: dict[str, list[EpisodeRecord]]
    scenarios: str
    speeds: dict[Key, float]
    environment: dict[str, Any]
    command: str
    warnings: tuple[str, ...]


def read_run(folder: Path) -> Run:
    """A run folder.

    Raises:
        BadConfig: naming the file, the key and what is wrong with it.
    """
    if not folder.is_dir():
        raise BadConfig(folder, "", "is not a run folder: there is no such folder")
    cells = _cells(folder)
    described = _json(folder / "scenarios.json")
    listed = described.get("scenarios") if isinstance(described, dict) else None
    if not isinstance(listed, list) or not all(isinstance(entry, dict) for entry in listed):
        raise BadConfig(folder / "scenarios.json", "scenarios", "is not a list of tables")
    environment = _json(folder / "environment.json")
    if not isinstance(environment, dict):
        raise BadConfig(folder / "environment.json", "", "does not hold a table")
    records, warnings = _records(folder / FILE, cells)
    canonical = json.dumps(listed, sort_keys=True, separators=(",", ":"))
    return Run(
        folders=(folder,),
        cells=cells,
        records=records,
        scenarios=str(described.get("hash") or hashlib.sha256(canonical.encode()).hexdigest()[:12]),
        speeds=_speeds(listed, cells),
        environment=environment,
        command=str(environment.get("command", "")),
        warnings=warnings,
    )


def merged(runs: list[Run]) -> Run:
    """Several runs as one; of an episode that is in more than one the first counts.

    Raises:
        BadConfig: they are not of the same scenarios.
    """
    first = runs[0]
    cells = {cell.digest: cell for cell in first.cells}
    records = {digest: {r.index: r for r in found} for digest, found in first.records.items()}
    warnings = list(first.warnings)
    for run in runs[1:]:
        if run.scenarios != first.scenarios:
            other = f"{first.scenarios!r} in {first.folders[0]}"
            raise BadConfig(run.folders[0], "scenarios", f"hash {run.scenarios!r} is not {other}: nothing to compare")
        cells = {**{cell.digest: cell for cell in run.cells}, **cells}
        warnings += run.warnings
        for digest, found in run.records.items():
            known = records.setdefault(digest, {})
            differing = sum(r.index in known and result_of(r) != result_of(known[r.index]) for r in found)
            if differing:
                warnings.append(f"{run.folders[0]}: {differing} episodes of cell {digest} ended differently before")
            records[digest] = {**{r.index: r for r in found}, **known}
    return Run(
        folders=tuple(folder for run in runs for folder in run.folders),
        cells=tuple(cells.values()),
        records={digest: [found[index] for index in sorted(found)] for digest, found in records.items()},
        scenarios=first.scenarios,
        speeds={key: speed for run in reversed(runs) for key, speed in run.speeds.items()},
        environment=first.environment,
        command="",
        warnings=tuple(warnings),
    )


def result_of(record: EpisodeRecord) -> dict[str, Any]:
    """A record without what the clock said."""
    return {field.name: getattr(record, field.name) for field in fields(record) if field.name not in TIMINGS}


def results_hash(run: Run) -> str:
    """Twelve hexadecimal digits of all results: equal for equal ones, whoever ran them and how fast."""
    digest = hashlib.sha256()
    for cell in sorted(run.records):
        for record in run.records[cell]:
            digest.update(json.dumps(result_of(record), sort_keys=True, separators=(",", ":")).encode())
    return digest.hexdigest()[:12]


def _json(path: Path) -> Any:
    try:
        return parsed(path, MAX_BYTES)
    except Refused as refused:
        raise BadConfig(path, "" if refused.key == "file" else refused.key, refused.reason) from None


def _cells(folder: Path) -> tuple[Cell, ...]:
    """Those of `cells.json`; in a folder of one cell the config is the cell."""
    path = folder / "cells.json"
    if not path.exists():
        described = _json(folder / "scenarios.json")
        digest = described.get("digest") if isinstance(described, dict) else None
        return (_cell(folder / "config.yaml", "", {**load_mapping(folder / "config.yaml"), "digest": digest}),)
    entries = _json(path)
    if not isinstance(entries, list) or not entries:
        raise BadConfig(path, "", "is not a list of at least one cell")
    return tuple(_cell(path, f"[{k}]", entry) for k, entry in enumerate(entries))


def _cell(path: Path, key: str, entry: Any) -> Cell:
    if not isinstance(entry, dict):
        raise BadConfig(path, key, "is not a table")
    if isinstance(entry.get("config"), dict):
        entry = {**entry["config"], "digest": entry.get("digest")}
    for name, kind in CONFIG_KEYS.items():
        if not isinstance(entry.get(name), kind) or isinstance(entry[name], bool):
            raise BadConfig(
                path, f"{key}.{name}".lstrip("."), f"is {entry.get(name)!r:.60}, not of type {kind.__name__}"
            )
    digest = entry.get("digest")
    if not isinstance(digest, str) or not DIGEST.fullmatch(digest):
        raise BadConfig(path, f"{key}.digest".lstrip("."), f"is {digest!r:.60}, not 12 hexadecimal digits")
    settings = entry.get("settings")
    values = {name: entry[name] for name in CONFIG_KEYS if name != "episodes"}
    return Cell(digest, planned=entry["episodes"], settings=settings if isinstance(settings, dict) else {}, **values)


def _records(path: Path, cells: Iterable[Cell]) -> tuple[dict[str, list[EpisodeRecord]], tuple[str, ...]]:
    """Records of each cell by index, the first of each; and what was passed over."""
    found: dict[str, dict[int, EpisodeRecord]] = {cell.digest: {} for cell in cells}
    read, foreign = read_records(path)
    bad, strangers = len(foreign), 0
    for record in read:
        if not _is_sound(record):
            bad += 1
        elif record.cell not in found:
            strangers += 1
        else:
            found[record.cell].setdefault(record.index, record)
    warnings = []
    if bad:
        warnings.append(f"{path.name}: {bad} lines are no episode records and were passed over")
    if strangers:
        warnings.append(f"{path.name}: {strangers} episodes are of cells that this run does not have")
    return {digest: [known[k] for k in sorted(known)] for digest, known in found.items()}, tuple(warnings)


def _is_sound(record: EpisodeRecord) -> bool:
    """Whether all entries are of the types that they should be."""
    number = (int, float)
    return (
        all(isinstance(getattr(record, name), str) for name in _WORDS)
        and all(isinstance(getattr(record, name), int) for name in ("index", "seed", "contacts", "refused"))
        and isinstance(record.seconds, number)
        and isinstance(record.wall_seconds, number)
        and isinstance(record.metrics, dict)
        and all(value is None or isinstance(value, number) for value in record.metrics.values())
        and isinstance(record.tick_us, list)
        and len(record.tick_us) >= 3
        and all(isinstance(value, number) for value in record.tick_us)
    )


_WORDS = [field.name for field in fields(EpisodeRecord) if field.type == "str"]


def _speeds(listed: list[dict[str, Any]], cells: tuple[Cell, ...]) -> dict[Key, float]:
    """Largest speed of the obstacles of each scenario; scenarios without the drawn obstacles have none."""
    only = cells[0]
    found = {}
    for entry in listed:
        obstacles, seed = entry.get("obstacles"), entry.get("seed")
        if isinstance(obstacles, list) and obstacles and isinstance(seed, int):
            words = (entry.get("task", only.task), entry.get("robot", only.robot), entry.get("level", only.level))
            task, robot, level = (str(word) for word in words)
            found[task, robot, level, seed] = max(peak_speed(obstacle) for obstacle in obstacles)
    return found


def peak_speed(obstacle: Any) -> float:
    """Largest speed [m/s] of an obstacle described as `envs.obstacles.Intruder` is; 0 of one that stands still."""
    if not isinstance(obstacle, dict):
        return 0.0
    try:
        frequency = float(obstacle.get("frequency", 0.0))
        axes = [np.linalg.norm(np.asarray(obstacle.get(key, (0.0,)), dtype=np.float64)) for key in ("long", "short")]
    except (TypeError, ValueError):
        return 0.0
    speed = abs(frequency) * float(max(axes))
    return speed if np.isfinite(speed) else 0.0
