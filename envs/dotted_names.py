"""Objects in users' own modules, by a dotted path `my_package.my_module:name`."""

from __future__ import annotations

import sys
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

from ..planner.errors import OneDemoError


class BadDottedName(OneDemoError, ValueError):
    """A dotted path names nothing that can be imported."""

    def __init__(self, path: str, reason: str):
        self.path, self.reason = path, reason
        super().__init__(f"{path}: {reason}")


def is_dotted(name: object) -> bool:
    """Return whether a name is a dotted path, not the name of something shipped."""
    return isinstance(name, str) and ":" in name


def imported(path: str, form: str, wanted: Callable[[Any], bool]) -> Any:
    """Import the object that a dotted path names; importing its module runs its code.

    The module is searched on Python's path and in the current folder.

    Args:
        path: dotted path.
        form: how such a path looks, for the message.
        wanted: whether an object is of the kind that is looked for, for the message; the object itself is not checked.

    Raises:
        BadDottedName: no such module or name.
    """
    module, _, attribute = path.partition(":")
    if module.endswith(".py"):
        raise BadDottedName(path, f"names a file: leave .py out, {module.removesuffix('.py')}:{attribute}")
    if not module or not attribute.isidentifier() or not all(part.isidentifier() for part in module.split(".")):
        raise BadDottedName(path, f"is not of the form {form}")
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        found = import_module(module)
    except Exception as error:
        raise BadDottedName(path, f"importing {module}: {said(error)}") from error
    finally:
        sys.path.remove(here)
    if not hasattr(found, attribute):
        known = ", ".join(key for key, value in vars(found).items() if not key.startswith("_") and wanted(value))
        raise BadDottedName(path, f"{module} has no {attribute!r}; of this kind it has: {known or 'nothing'}")
    return getattr(found, attribute)


def said(error: Exception) -> str:
    """Return an error as one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
