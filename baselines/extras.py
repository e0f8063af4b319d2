"""Libraries that only some policies need: imported when they are needed, named with the extra that brings them."""

from __future__ import annotations

from importlib import import_module
from types import ModuleType

from ..planner.errors import MissingExtra


def needed(module: str, extra: str) -> ModuleType:
    """A module of an optional library.

    Args:
        module: its name.
        extra: of the extras of onedemo the one that brings it.

    Raises:
        MissingExtra: it is not installed.
    """
    try:
        return import_module(module)
    except ImportError as error:
        raise MissingExtra(module.partition(".")[0], extra, str(error)) from None
