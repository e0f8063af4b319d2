"""Drawing libraries that other libraries import: imported when something is drawn, if ever."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from importlib import import_module
from types import ModuleType
from typing import Any


class _Deferred(ModuleType):
    """Stands for a module, and imports it at the first use of one of its names."""

    def __getattr__(self, name: str) -> Any:
        if name.startswith("__"):  # the import system asks for these
            raise AttributeError(name)
        return getattr(import_module(self.__name__), name)


@contextmanager
def deferred(*names: str) -> Iterator[None]:
    """Defer the import of modules by libraries that are imported in the `with` block, until these use them.

    A drawing library takes up to a second to import, and may be missing or broken where nothing is ever drawn. Modules
    that are imported already stay as they are.

    Args:
        names: modules, packages before what lies in them; `module:function` for a function that the libraries take
            from the module at once.
    """
    stand_ins: dict[str, ModuleType] = {}
    for name in names:
        module, _, function = name.partition(":")
        if module in sys.modules:
            continue
        stand_in = stand_ins[module] = _Deferred(module)
        if function:
            setattr(stand_in, function, _later(module, function))
        package, _, last = module.rpartition(".")
        if package in stand_ins:
            setattr(stand_ins[package], last, stand_in)
    sys.modules.update(stand_ins)
    try:
        yield
    finally:
        for module, stand_in in stand_ins.items():
            if sys.modules.get(module) is stand_in:
                del sys.modules[module]


def _later(module: str, function: str) -> Callable[..., Any]:
    return lambda *args, **named: getattr(import_module(module), function)(*args, **named)
