"""Comparisons: the cells described by one config file."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from math import prod
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from .dotted_keys import MISSING, at, having, leaves, merged, without
from .errors import BadConfig, unknown_key
from .run_config import (
    CELL_KEYS,
    FAMILIES,
    LATER,
    RUN_KEYS,
    SWITCHES,
    Default,
    RunConfig,
    RunSettings,
    digest_of,
    present_method,
    reason_of,
)
from .shipped_files import shipped_demonstrations
from .strict_yaml import COMMAND_LINE, load_mapping, with_overrides, with_switches

MAX_CELLS = 10_000
ALLOWED = (*CELL_KEYS, *RUN_KEYS)
FIXED = ("name", "video", "trajectories")
"""Keys with the same value in all cells."""
NAMING = ("task", "robot", "level", "method")
"""Keys that name a cell."""


@dataclass(frozen=True, slots=True)
class Grid:
    """All cells of a run.

    Attributes:
        source: config file.
        changed: keys changed on the command line.
        written: contents of the file, with these changes.
        settings: how the cells are generated and run.
        cells: cells in order.
    """

    source: Path
    changed: tuple[str, ...]
    written: dict[str, Any]
    settings: RunSettings
    cells: tuple[RunConfig, ...]

    @property
    def name(self) -> str:
        """First part of the run folder's name."""
        return self.cells[0].name

    def digest(self) -> str:
        """Return twelve hexadecimal digits of all values that determine the table."""
        return digest_of([self.name, [[cell.digest(), cell.episodes] for cell in self.cells]])

    def label(self, cell: RunConfig) -> str:
        """Return a cell in words: task, robot, level, method, and other swept keys."""
        values = cell.model_dump(mode="json")
        said = (*NAMING, *(f"env.{key}" for key in FAMILIES.get(cell.task, ())))
        more = [key for key in self.settings.sweep if key not in said]
        found = {key: at(values, key) for key in more}
        named = [f"{key}={_worded(value)}" for key, value in found.items() if not (value is MISSING and key in LATER)]
        return " ".join([cell.task_words, *(values[key] for key in NAMING[1:]), *named])

    def blame(self, key: str) -> str | Path:
        """Return the place where a key was written: the command line or the file."""
        return _blame(self.source, self.changed, key)


def load_grid(path: str | Path, overrides: list[str] | None = None) -> Grid:
    """Load and check a config file with `key=value` changes.

    A change of a swept key replaces its values; a sweep of a key replaces its value.

    Args:
        path: config file.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: names the file, or the command line, and the key, and the allowed values.
    """
    return grid_of(load_mapping(path), path, overrides)


def grid_of(values: dict[str, Any], path: str | Path, overrides: list[str] | None = None) -> Grid:
    """Check the content of a config file with `key=value` changes; see `load_grid`.

    Args:
        values: content of the file.
        path: the file, or what stands for it in messages.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: see `load_grid`.
    """
    changes = overrides or []
    changed = tuple(text.partition("=")[0] for text in changes)
    if isinstance(values.get("sweep"), dict):
        values["sweep"] = _unfolded(values["sweep"], path)
    values = with_switches(with_overrides(values, changes), changed, SWITCHES)
    for key in changed:
        swept = key.removeprefix("sweep.")
        if swept != key and swept not in changed:  # what is swept on the command line has no single value any more
            values = without(values, swept)
    if isinstance(values.get("sweep"), dict):
        for key in changed:
            values["sweep"] = without(values["sweep"], key)
        values["sweep"] = dict(leaves(values["sweep"]))
    values = _with_present_methods(values)
    for key in values:
        if key not in ALLOWED:
            raise BadConfig(_blame(path, changed, str(key)), str(key), unknown_key(str(key), ALLOWED))
    settings = _settings(values, path, changed)
    base = {key: value for key, value in values.items() if key in CELL_KEYS}
    return Grid(Path(path), changed, values, settings, _cells(base, settings, path, changed))


def load_config(path: str | Path, overrides: list[str] | None = None) -> RunConfig:
    """Load and check the only cell of a config file with `key=value` changes.

    Args:
        path: config file.
        overrides: changes, each `key=value`.

    Raises:
        BadConfig: names the file, or the command line, and the key, and the allowed values; or there are several cells.
    """
    cells = load_grid(path, overrides).cells
    if len(cells) != 1:
        raise BadConfig(path, "sweep", f"gives {len(cells)} cells; a single one is expected")
    return cells[0]


def _blame(path: str | Path, changed: tuple[str, ...], key: str) -> str | Path:
    first = key.split(".")[0]
    return COMMAND_LINE if first in {text.split(".")[0] for text in changed} else path


def _with_present_methods(value: Any) -> Any:
    """Return the content of a config with the present names of methods, in sweeps and conditions too."""
    if isinstance(value, list):
        return [_with_present_methods(each) for each in value]
    if not isinstance(value, dict):
        return value
    inner = {key: each if key in ("settings", "env") else _with_present_methods(each) for key, each in value.items()}
    named = inner.get("method")
    if isinstance(named, str):
        inner["method"] = present_method(named)
    elif isinstance(named, list):
        inner["method"] = [present_method(each) if isinstance(each, str) else each for each in named]
    return inner


def _unfolded(sweep: Mapping[str, Any], path: str | Path) -> dict[str, Any]:
    """Return a sweep with nested mappings instead of dotted keys, so that changes find them."""
    result: dict[str, Any] = {}
    for key, values in leaves(sweep):
        if at(result, key) is not MISSING:
            raise BadConfig(path, f"sweep.{key}", "is there twice")
        result = having(result, key, values)
    return result


def _settings(values: dict[str, Any], path: str | Path, changed: tuple[str, ...]) -> RunSettings:
    """Return the run settings, after checking that the keys they refer to are keys of a cell."""
    try:
        settings = RunSettings.model_validate({key: values[key] for key in RUN_KEYS if key in values})
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        allowed = tuple(Default.model_fields) if key.startswith("defaults") else RUN_KEYS
        raise BadConfig(_blame(path, changed, key), key, reason_of(first, allowed)) from None
    for key, choices in settings.sweep.items():
        _check_cell_key(path, changed, f"sweep.{key}", key)
        if any(choices[k] in choices[:k] for k in range(len(choices))):
            raise BadConfig(_blame(path, changed, "sweep"), f"sweep.{key}", f"holds a value twice: {choices}")
        if at(values, key) is not MISSING:
            raise BadConfig(_blame(path, changed, key), key, "has a value, but is swept too: write one or the other")
    conditions = [(f"exclude.{k}", condition) for k, condition in enumerate(settings.exclude)]
    for k, default in enumerate(settings.defaults):
        conditions.append((f"defaults.{k}.when", default.when))
        for key in default.set:
            _check_cell_key(path, changed, f"defaults.{k}.set.{key}", key)
    for where, condition in conditions:
        for key in condition:
            _check_cell_key(path, changed, f"{where}.{key}", key)
    if settings.address is not None and settings.executor != "ray":
        where = _blame(path, changed, "address")
        raise BadConfig(where, "address", f"is only for executor: ray, which is {settings.executor!r}")
    return settings


def _check_cell_key(path: str | Path, changed: tuple[str, ...], where: str, key: str) -> None:
    allowed = tuple(each for each in CELL_KEYS if each not in FIXED)
    if key.split(".")[0] not in allowed:
        raise BadConfig(_blame(path, changed, where), where, unknown_key(key, allowed))


def _cells(
    base: dict[str, Any], settings: RunSettings, path: str | Path, changed: tuple[str, ...]
) -> tuple[RunConfig, ...]:
    count = prod(len(values) for values in settings.sweep.values())
    if count > MAX_CELLS:
        raise BadConfig(path, "sweep", f"gives {count} cells; at most {MAX_CELLS} are possible")
    cells, used = {}, [False] * len(settings.exclude)
    for choice in product(*settings.sweep.values()):
        chosen = dict(zip(settings.sweep, choice, strict=True))
        values = base
        for key, value in chosen.items():
            values = having(values, key, value)
        hits = [_matches(values, condition) for condition in settings.exclude]
        used = [before or hit for before, hit in zip(used, hits, strict=True)]
        if any(hits):
            continue
        weak: dict[str, Any] = {}
        for default in settings.defaults:
            if _matches(values, default.when):
                weak = merged(weak, default.set)
        cell = _cell(merged(weak, values), chosen, path, changed, settings.defaults)
        if cell.digest() in cells:
            raise BadConfig(path, "sweep", f"gives the same cell twice: {_combination(chosen)}")
        cells[cell.digest()] = cell
    # after a change on the command line, a condition may rightly exclude nothing
    if not all(used) and not changed:
        raise BadConfig(path, f"exclude.{used.index(False)}", "leaves out nothing: no combination has these values")
    if not cells:
        raise BadConfig(path, "exclude", "leaves nothing to run")
    return tuple(cells.values())


def _cell(
    values: dict[str, Any],
    chosen: dict[str, Any],
    path: str | Path,
    changed: tuple[str, ...],
    defaults: Sequence[Default],
) -> RunConfig:
    try:
        return RunConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        cell = f" (in the cell {_combination(chosen)})" if chosen else ""
        reason = reason_of(first, ALLOWED) + cell + _advice(key, first, values, defaults)
        raise BadConfig(_blame(path, changed, key), key, reason) from None


def _advice(key: str, error: Any, values: Mapping[str, Any], defaults: Sequence[Default]) -> str:
    """Return what to write instead, where that can be said; else ""."""
    if error["type"] == "missing":
        conditions = [default.when for default in defaults if key in default.set]
        if conditions:
            return f"; {_conditions(conditions, values)}"
    if error["type"] == "missing" and key == "demonstration":
        known = shipped_demonstrations()
        name = values.get("task") if values.get("task") in known else known[0]
        return f"; write demonstration: {name}, or a file; shipped are {', '.join(known)}"
    if isinstance(error["input"], list) and key in CELL_KEYS and key not in FIXED:
        return f"; to run each of several, write 'sweep.{key}=[...]', in a file sweep: {{{key}: [...]}}"
    return ""


def _conditions(conditions: Sequence[Mapping[str, Any]], values: Mapping[str, Any]) -> str:
    """Return with which values a config sets what is missing, and what the cell has instead."""
    said = []
    for key in dict.fromkeys(key for condition in conditions for key in condition):
        wanted = [condition[key] for condition in conditions if key in condition]
        known = [each for value in wanted for each in (value if isinstance(value, list) else [value])]
        said.append(f"{key}={at(values, key)} is none of {', '.join(map(str, dict.fromkeys(known)))}")
    return f"the config sets it for some cells, and here {' or '.join(said)}"


def _matches(values: Mapping[str, Any], condition: Mapping[str, Any]) -> bool:
    """Return whether a cell has the values, or one of the listed ones; missing keys have their default."""
    for key, wanted in condition.items():
        value = at(values, key)
        if value is MISSING and key in RunConfig.model_fields:
            value = RunConfig.model_fields[key].get_default(call_default_factory=True)
        if value not in (wanted if isinstance(wanted, list) else [wanted]):
            return False
    return True


def _combination(chosen: Mapping[str, Any]) -> str:
    return " ".join(f"{key}={value}" for key, value in chosen.items())


def _worded(value: Any) -> str:
    return "default" if value is MISSING else str(value)
