"""Compilation of the numeric kernels.

numba's disk cache ignores changes in functions imported from another file. So the kernels of a file are cached in a
folder named after the content of that file and of all project files that it imports, directly or not: an edit starts
a fresh cache only for the dependent files, and an installation in a read-only folder is compiled once per user
instead of once per process.
"""

from __future__ import annotations

import ast
import hashlib
import os
import tempfile
from collections.abc import Callable, Iterator
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numba

config: Any = import_module("numba.core.config")
# the kernels are scalar code: vectorization takes a fifth of the compile time and gains nothing
config.LOOP_VECTORIZE = config.SLP_VECTORIZE = 0


@cache
def _imported(source: Path) -> frozenset[Path]:
    """Return the project files that a file imports, anywhere in the file."""
    nodes = _relative_imports(source)
    return frozenset(file for node in nodes for alias in node.names for file in _files_of(source, node, alias.name))


def _relative_imports(source: Path) -> list[ast.ImportFrom]:
    tree = ast.parse(source.read_text(encoding="utf-8"))
    return [node for node in ast.walk(tree) if isinstance(node, ast.ImportFrom) and node.level]


def _files_of(source: Path, node: ast.ImportFrom, name: str) -> Iterator[Path]:
    """Yield the file of an imported module, or of the module in a package that an imported name comes from."""
    base = source.parents[node.level - 1].joinpath(*node.module.split(".") if node.module else ())
    package = base / "__init__.py"
    for file in (base.with_suffix(".py"), base / f"{name}.py"):
        if file.is_file():
            yield file
            return
    if package.is_file():  # a package interface: only the module it imports the name from
        for inner_node in _relative_imports(package):
            if name in [alias.name for alias in inner_node.names]:
                yield from _files_of(package, inner_node, name)


@cache
def content_digest(source: Path) -> str:
    """Return the digest of a file and of all project files that it imports, directly or not."""
    seen, todo = set(), [source]
    while todo:
        file = todo.pop()
        if file not in seen:
            seen.add(file)
            todo += _imported(file)
    digest = hashlib.sha256()
    for file in sorted(seen):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder(source: Path) -> Path:
    """Return the folder of a file's compiled kernels: `NUMBA_CACHE_DIR` if set, else one per user and content."""
    if config.CACHE_DIR:
        return Path(config.CACHE_DIR)
    root = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    folder = root / "onedemo" / "kernels" / content_digest(source)
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError:  # no home, or a read-only one
        folder = Path(tempfile.gettempdir()) / f"onedemo-kernels-{os.getuid()}" / folder.name
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)
    return folder


def kernel(function: Callable[..., Any]) -> Any:
    """Compile a function of floats, tuples and float64 arrays; exact IEEE order, cached on disk.

    A kernel releases the GIL, so that threads run in parallel.
    """
    return _compiled(function, {})


def inner(function: Callable[..., Any]) -> Any:
    """Compile a function called by kernels only: without an entry for Python, saving a third of the compile time."""
    return _compiled(function, {"no_cpython_wrapper": True, "no_cfunc_wrapper": True})


def inlined(function: Callable[..., Any]) -> Any:
    """Compile a short function into every kernel that calls it: passing arrays costs more than the function."""
    return _compiled(function, {"forceinline": True})


def _compiled(function: Callable[..., Any], options: dict[str, Any]) -> Any:
    before = config.CACHE_DIR
    # nothing is allocated in a kernel, so references to arrays need not be counted: counting is atomic, happens at
    # every inlined call, and took as long as a distance query. A kernel that allocates does not compile
    options["_nrt"] = False
    config.CACHE_DIR = str(cache_folder(Path(function.__code__.co_filename)))
    try:
        compiler: Any = numba.njit
        return compiler(cache=True, error_model="numpy", nogil=True, **options)(function)
    finally:
        config.CACHE_DIR = before
