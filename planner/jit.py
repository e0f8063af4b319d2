"""The compiler of the numeric kernels.

numba's disk cache does not notice a change in a function that is imported from another file. So the
kernels are cached in a folder named after the content of this package: any edit starts a fresh cache,
and an installation in a read-only folder is compiled once per user instead of once per process.
"""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Callable
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numba

config: Any = import_module("numba.core.config")


@cache
def cache_folder() -> Path:
    """Folder of the compiled kernels: `NUMBA_CACHE_DIR` if set, else one per user and content."""
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR)
    digest = hashlib.sha256()
    for source in sorted(Path(__file__).parent.glob("*.py")):
        digest.update(source.read_bytes())
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = root / "onedemo" / "kernels" / digest.hexdigest()[:16]
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # no home, or a read-only one
        folder = Path(tempfile.gettempdir()) / f"onedemo-kernels-{os.getuid()}" / folder.name
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return folder


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of floats, tuples and float64 arrays; exact IEEE order, cached on disk."""
    before = config.CACHE_DIR
    config.CACHE_DIR = str(cache_folder())
    try:
        return numba.njit(cache=True, error_model="numpy")(function)
    finally:
        config.CACHE_DIR = before
