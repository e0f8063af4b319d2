"""Optional libraries: imported only when needed, and named with the extra that installs them."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from .errors import MissingExtra


def needed(module: str, extra: str) -> ModuleType:
    """Import a module of an optional library.

    Args:
        module: name of the module.
        extra: extra of onedemo that installs it.

    Raises:
        MissingExtra: the library is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtra(module.partition(".")[0], extra, str(error)) from None
