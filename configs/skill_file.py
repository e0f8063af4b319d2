"""Corrections of a demonstration's skill, in a small YAML file beside it: `mine.npz` has `mine.skill.yaml`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML

from ..planner.imitation.corrections import Corrections, PhaseCorrection
from .dataclass_settings import settings_from
from .errors import BadConfig, unknown_key
from .strict_yaml import COMMAND_LINE, load_mapping, parse

KEYS = ("names", "phases")
ENDING = ".skill.yaml"


def skill_file(demonstration: Path) -> Path:
    """Return the file with the corrections of a demonstration's file, which need not be there."""
    return demonstration.with_suffix(ENDING)


def read_corrections(file: Path) -> Corrections:
    """Read corrections; those of a file that is not there are none.

    Raises:
        BadConfig: the file is no YAML, or a key or value is not allowed; the message names both.
    """
    return corrections_of(load_mapping(file), str(file)) if file.is_file() else Corrections()


def corrections_of(values: dict[str, Any], source: str) -> Corrections:
    """Return the corrections in a mapping as parsed from YAML.

    Args:
        values: the mapping.
        source: file or place, for messages.

    Raises:
        BadConfig: a key or value is not allowed.
    """
    for key, value in values.items():
        if key not in KEYS:
            raise BadConfig(source, key, unknown_key(key, KEYS))
        if not isinstance(value, dict):
            raise BadConfig(source, key, "does not hold `name: …` lines")
    names = values.get("names", {})
    for name, other in names.items():
        if not isinstance(other, str):
            raise BadConfig(source, f"names.{name}", f"is not the name of a thing in the task, got {other!r}")
    phases = {name: _phase(name, said, source) for name, said in values.get("phases", {}).items()}
    return Corrections(names, phases, source)


def _phase(name: str, said: Any, source: str) -> PhaseCorrection:
    if not isinstance(said, dict):
        raise BadConfig(source, f"phases.{name}", "does not hold `key: value` lines")
    try:
        return settings_from(PhaseCorrection, said, source)
    except BadConfig as error:
        raise BadConfig(source, f"phases.{name}.{error.key}", error.reason) from None


def with_said(corrections: Corrections, texts: Sequence[str]) -> Corrections:
    """Return corrections with more, as said on the command line.

    Args:
        corrections: those so far.
        texts: each "PHASE: KEY=VALUE", like "carry nut: reference=peg", or "NAME=NAME" of the task.

    Raises:
        BadConfig: a text has another form, or a key or value is not allowed.
    """
    values = as_mapping(corrections)
    for text in texts:
        phase, colon, said = text.rpartition(":")
        key, equals, value = (part.strip() for part in said.partition("="))
        if not equals or not key or not value:
            raise BadConfig(COMMAND_LINE, text, "is not of the form 'PHASE: KEY=VALUE' or 'NAME=NAME IN THE TASK'")
        if colon:
            values.setdefault("phases", {}).setdefault(phase.strip(), {})[key] = parse(value, COMMAND_LINE)
        else:
            values.setdefault("names", {})[key] = value
    return corrections_of(values, COMMAND_LINE)


def as_mapping(corrections: Corrections) -> dict[str, Any]:
    """Return corrections as their file has them."""
    phases = {name: {key: asdict(each)[key] for key in each.said()} for name, each in corrections.phases.items()}
    return {key: value for key, value in (("names", dict(corrections.names)), ("phases", phases)) if value}


def write_corrections(corrections: Corrections, file: Path) -> None:
    """Write corrections to a file.

    Args:
        corrections: to be written.
        file: replaced if it is there.

    Raises:
        OSError: the file cannot be written.
    """
    with file.open("w", encoding="utf-8") as out:
        YAML(typ="safe", pure=True).dump(as_mapping(corrections), out)
