"""Users' own policies, given by a dotted path `my_package.my_module:MyPolicy`; see docs/own_policy.md."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from copy import deepcopy
from importlib import import_module
from pathlib import Path
from typing import Any, cast

from ..configs import BadConfig
from ..envs import TaskDescription
from ..planner import Demonstration
from ..planner.errors import OneDemoError
from .policy import Policy

FORM = "my_package.my_module:MyPolicy"


def is_own(name: str) -> bool:
    """Return whether a method is a dotted path instead of the name of a shipped policy."""
    return ":" in name


def own_policy(name: str, task: TaskDescription, demonstration: Demonstration, settings: Mapping[str, Any]) -> Policy:
    """Import the object that a dotted path names, and call it with task, demonstration and settings.

    The module is searched on Python's path and in the current folder. Importing it runs its code.

    Args:
        name: dotted path.
        task: see `make_policy`.
        demonstration: see `make_policy`.
        settings: settings of the config, unchecked.

    Raises:
        BadConfig: no such module or name, or the result is no policy.
    """
    make = _named(name)
    if not callable(make):
        raise BadConfig("method", name, f"is a {type(make).__name__}, not a class or function")
    try:
        policy = make(task, demonstration, deepcopy(dict(settings)))  # the config's own serve further episodes
    except OneDemoError:
        raise
    except Exception as error:
        raise BadConfig("method", name, f"called with task, demonstration and settings: {_said(error)}") from error
    if not callable(getattr(policy, "predict", None)):
        raise BadConfig("method", name, f"gives a {type(policy).__name__} without a method predict")
    return cast(Policy, policy)


def _named(name: str) -> Any:
    module, _, attribute = name.partition(":")
    if not module or not attribute.isidentifier() or not all(part.isidentifier() for part in module.split(".")):
        raise BadConfig("method", name, f"is not of the form {FORM}")
    here = str(Path.cwd())
    sys.path.insert(0, here)
    try:
        found = import_module(module)
    except Exception as error:
        raise BadConfig("method", name, f"importing {module}: {_said(error)}") from error
    finally:
        sys.path.remove(here)
    if not hasattr(found, attribute):
        known = ", ".join(key for key in vars(found) if not key.startswith("_")) or "nothing"
        raise BadConfig("method", name, f"{module} has no {attribute!r}; it has: {known}")
    return getattr(found, attribute)


def _said(error: Exception) -> str:
    """Return an error as one line."""
    text = " ".join(str(error).split())
    return f"{type(error).__name__}: {text}" if text else type(error).__name__
