"""Lazy public names of a package (PEP 562): a name is imported when it is first asked for."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping, Sequence
from importlib import import_module
from typing import Any


def lazy_names(
    package: str, modules: Mapping[str, tuple[str, ...]], packages: Sequence[str] = ()
) -> tuple[Callable[[str], Any], Callable[[], list[str]]]:
    """Return `__getattr__` and `__dir__` of a package whose public names are imported on first use.

    Importing any module runs the `__init__` of all packages above it, so a package that imported its public names
    at once would load the compiler (1 s) and the simulator for every small thing.

    Args:
        package: its `__name__`.
        modules: names by the module that defines them, relative to the package, like {".geometry.pose": ("Pose",)}.
        packages: packages directly below this one that are attributes, too.
    """
    where = {name: module for module, names in modules.items() for name in names}

    def get(name: str) -> Any:
        if name in packages:
            return import_module(f"{package}.{name}")
        if name not in where:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        value = getattr(import_module(where[name], package), name)
        setattr(sys.modules[package], name, value)
        return value

    def names() -> list[str]:
        return sorted({*where, *packages, *vars(sys.modules[package])["__all__"]})

    return get, names
