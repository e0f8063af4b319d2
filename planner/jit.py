"""Compilation of the numeric kernels.

numba's disk cache ignores changes in functions imported from another file. So the kernels of a file are cached in a
folder named after the content of that file and of all project files that it imports, directly or not: an edit starts
a fresh cache only for the dependent files. The folder lies below `NUMBA_CACHE_DIR`, else in the user's cache, else,
where that cannot be written, in the temporary folder. Where nothing can be written, kernels are compiled anew in every
process.
"""

from __future__ import annotations

import ast
import hashlib
import os
import stat
import tempfile
import warnings
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

import numba

config: Any = import_module("numba.core.config")
# the kernels are scalar code: vectorization takes a fifth of the compile time and gains nothing
config.LOOP_VECTORIZE = config.SLP_VECTORIZE = 0

PROBE = bytes(65536)
"""Content written into a folder on trial: a full disk may still take an empty file."""


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
    """Return the digest of a file and of all project files that it imports, directly or not.

    Kernels that check their indices (`NUMBA_BOUNDSCHECK=1`) have another one.
    """
    seen, todo = set(), [source]
    while todo:
        file = todo.pop()
        if file not in seen:
            seen.add(file)
            todo += _imported(file)
    digest = hashlib.sha256(b"checked" if config.BOUNDSCHECK else b"")
    for file in sorted(seen):
        digest.update(file.read_bytes())
    return digest.hexdigest()[:16]


@cache
def cache_folder(source: Path) -> Path | None:
    """Return the folder of a file's compiled kernels, named after its content; None if none can be written."""
    if not source.is_file():
        return None
    folders = (root / content_digest(source) for root in _cache_roots())
    found = next((folder for folder in folders if _can_be_written(folder)), None)
    if found is None:
        _warn("there is no folder to keep compiled kernels in")
    return found


def _cache_roots() -> Iterator[Path]:
    """Yield the folders below which kernels may be cached, the preferred one first."""
    if config.CACHE_DIR:
        yield Path(config.CACHE_DIR).absolute()
    else:
        base = _user_cache()
        if base is not None and not _is_foreign(base / "onedemo" / "kernels"):
            yield base / "onedemo" / "kernels"
    try:
        own = Path(tempfile.gettempdir()) / f"onedemo-kernels-{os.getuid()}"
        if _is_private(own):
            yield own
    except OSError:  # no temporary folder either
        return


def _user_cache() -> Path | None:
    """Return the user's cache folder; None for a user without a home."""
    named = Path(os.environ.get("XDG_CACHE_HOME", ""))
    if named.is_absolute():  # others are to be ignored, says the standard
        return named
    try:
        return Path.home() / ".cache"
    except RuntimeError:
        return None


def _is_foreign(folder: Path) -> bool:
    """Return whether a folder is somebody else's, whose compiled code should not be run; root is trusted."""
    try:
        return folder.stat().st_uid not in (0, os.getuid())
    except OSError:  # it is still to be made
        return False


def _is_private(folder: Path) -> bool:
    """Make a folder in a place where everybody may write; False if it is not this user's alone.

    Raises:
        OSError: it cannot be made.
    """
    folder.mkdir(mode=0o700, exist_ok=True)
    found = folder.lstat()  # of a link, not of what somebody lets it point to
    if not stat.S_ISDIR(found.st_mode) or found.st_uid != os.getuid() or found.st_mode & 0o022:
        return False
    folder.chmod(0o700)
    return True


def _can_be_written(folder: Path) -> bool:
    """Return whether files can be written into a folder, which is made if it is missing."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as file:
            file.write(PROBE)
    except OSError:
        return False
    return True


def _warn(reason: str) -> None:
    warnings.warn(f"{reason}: they are compiled anew in every process", stacklevel=2)


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
    # nothing is allocated in a kernel, so references to arrays need not be counted: counting is atomic, happens at
    # every inlined call, and took as long as a distance query. A kernel that allocates does not compile
    options["_nrt"] = False
    compiler: Any = numba.njit
    compiled = compiler(error_model="numpy", nogil=True, **options)(function)
    folder = cache_folder(Path(function.__code__.co_filename))
    if folder is not None and not config.DISABLE_JIT:
        _cache_in(compiled, folder)
    return compiled


def _cache_in(compiled: Any, folder: Path) -> None:
    """Let numba cache a kernel in a folder, and nowhere else: elsewhere it would miss changes of what is imported."""
    uncached, before = compiled._cache, config.CACHE_DIR
    config.CACHE_DIR = str(folder)
    try:
        compiled.enable_caching()
    except RuntimeError:  # numba finds no place
        return
    finally:
        config.CACHE_DIR = before
    inside = folder in Path(compiled._cache.cache_path).parents
    compiled._cache = _ForgivingCache(compiled._cache) if inside else uncached


class _ForgivingCache:
    """numba's cache of one kernel, whose failures cost time and no results."""

    def __init__(self, cache: Any):
        self._cache = cache

    def __getattr__(self, name: str) -> Any:
        return getattr(self._cache, name)

    def load_overload(self, signature: Any, context: Any) -> Any:
        """Return the compiled kernel; None if it is not there, or its file is damaged: that is dropped.

        Args:
            signature: of the call.
            context: numba's target.
        """
        try:
            return self._cache.load_overload(signature, context)
        except Exception:  # of pickle alone there are half a dozen
            with suppress(OSError):
                self._cache.flush()
            return None

    def save_overload(self, signature: Any, result: Any) -> None:
        """Save a compiled kernel, or say that it cannot be saved: the disk may have become full.

        Args:
            signature: of the call.
            result: of the compilation.
        """
        try:
            self._cache.save_overload(signature, result)
        except OSError as error:
            _warn(f"{self._cache.cache_path} takes no compiled kernels ({error})")
