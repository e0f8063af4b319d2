"""Demonstrations by name or file, with what is said of their skills."""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache
from pathlib import Path

from ..planner import Demonstration, read_demonstration
from .shipped_files import demonstration_path
from .skill_file import read_corrections, skill_file


def load_demonstration(name: str | Path) -> Demonstration:
    """Load a demonstration: a file, or a shipped one by its name, like "stack".

    Its corrections are those of the file `.skill.yaml` beside it, if there is one. Files that have not changed are read
    once per process.

    Args:
        name: the file, or the name of a shipped demonstration.

    Raises:
        BadDemonstration: the file cannot be read, or holds something else; the message names file and key.
        BadConfig: the file with its corrections has a key or value that is not allowed.
        UnknownName: no demonstration of that name is shipped; the message lists those that are.
    """
    path = demonstration_path(str(name))
    state = _state(path)
    if state is None:  # the reader says what is wrong with the file
        return read_demonstration(path)
    return _read(str(path.resolve()), path, state, _state(skill_file(path)))


def _state(path: Path) -> tuple[int, int] | None:
    """Return what changes with a file; None if there is none."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_mtime_ns, stat.st_size


@lru_cache(maxsize=32)
def _read(_place: str, path: Path, _state: tuple[int, int], corrections: tuple[int, int] | None) -> Demonstration:
    shown = read_demonstration(path)
    return shown if corrections is None else replace(shown, corrections=read_corrections(skill_file(path)))
