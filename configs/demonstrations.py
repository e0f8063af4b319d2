"""Demonstrations by name or file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from ..planner import Demonstration, read_demonstration
from .shipped_files import demonstration_path


def load_demonstration(name: str | Path) -> Demonstration:
    """Load a demonstration: a file, or a shipped one by its name, like "stack".

    A file that has not changed is read once per process.

    Args:
        name: the file, or the name of a shipped demonstration.

    Raises:
        BadDemonstration: the file cannot be read, or holds something else; the message names file and key.
        UnknownName: no demonstration of that name is shipped; the message lists those that are.
    """
    path = demonstration_path(str(name))
    try:
        stat = path.stat()
    except OSError:  # the reader says what is wrong with the file
        return read_demonstration(path)
    return _read(str(path.resolve()), path, stat.st_mtime_ns, stat.st_size)


@lru_cache(maxsize=32)
def _read(_place: str, path: Path, _modified: int, _size: int) -> Demonstration:
    return read_demonstration(path)
