"""Contents of users' own files in the cells of a run: a file that has changed makes another run."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Iterator
from dataclasses import replace
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

from ...configs import BadConfig, Grid, RunConfig
from ...configs.shipped_files import demonstration_path, is_shipped
from ...configs.skill_file import skill_file

DIGITS = 12
"""Hexadecimal digits of SHA-256 that tell contents apart."""


def with_contents(grid: Grid) -> Grid:
    """Return the grid with the SHA-256 of the files of one's own that decide about each cell.

    These are a demonstration that is not shipped, what is said of its skill, and the modules of dotted paths.

    Raises:
        BadConfig: the files have another SHA-256 than the config demands.
    """
    return replace(grid, cells=tuple(_with_contents(cell, grid) for cell in grid.cells))


def _with_contents(cell: RunConfig, grid: Grid) -> RunConfig:
    files = tuple(_own_files(cell))
    found = _digest(files, tuple((file.stat().st_mtime_ns, file.stat().st_size) for file in files)) if files else None
    if cell.contents is not None and cell.contents != found:
        names = ", ".join(map(str, files)) or "no file of one's own is used"
        reason = f"{cell.contents} is wanted; the files have {found} ({names})"
        raise BadConfig(grid.blame("contents"), "contents", reason)
    return cell.model_copy(update={"contents": found})


def _own_files(cell: RunConfig) -> Iterator[Path]:
    """Yield the files that decide about a cell and are not part of the project."""
    shown = demonstration_path(cell.demonstration)
    yield from (file for file in (shown, skill_file(shown)) if file.is_file() and not is_shipped(file))
    for name in (cell.task, cell.method):
        file = _module_file(name.partition(":")[0]) if ":" in name else None
        if file is not None:
            yield file


def _module_file(module: str) -> Path | None:
    """Return the file of a module on Python's path or in the current folder; None if it has none."""
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):  # whoever imports it says what is wrong
        return None
    finally:
        sys.path.remove(here)
    file = Path(spec.origin) if spec is not None and spec.origin else None
    return file if file is not None and file.is_file() else None


@lru_cache(maxsize=64)
def _digest(files: tuple[Path, ...], _states: tuple[tuple[int, int], ...]) -> str:
    digest = hashlib.sha256()
    for file in files:
        digest.update(hashlib.sha256(file.read_bytes()).digest())
    return digest.hexdigest()[:DIGITS]
