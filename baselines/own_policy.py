"""Users' own policies, given by a dotted path `my_package.my_module:MyPolicy`; see docs/own_policy.md."""

from __future__ import annotations

from collections.abc import Mapping
from copy import deepcopy
from typing import Any, cast

from ..configs import BadConfig
from ..envs import TaskDescription
from ..envs.dotted_names import BadDottedName, imported, is_dotted, said
from ..planner import Demonstration
from ..planner.errors import OneDemoError
from .policy import Policy

FORM = "my_package.my_module:MyPolicy"


def is_own(name: str) -> bool:
    """Return whether a method is a dotted path instead of the name of a shipped policy."""
    return is_dotted(name)


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
    try:
        module = name.partition(":")[0]
        make = imported(name, FORM, lambda found: callable(found) and found.__module__ == module)
    except BadDottedName as error:
        raise BadConfig("method", name, error.reason) from error
    if not callable(make):
        raise BadConfig("method", name, f"is a {type(make).__name__}, not a class or function")
    try:
        policy = make(task, demonstration, deepcopy(dict(settings)))  # the config's own serve further episodes
    except OneDemoError:
        raise
    except Exception as error:
        raise BadConfig("method", name, f"called with task, demonstration and settings: {said(error)}") from error
    if not callable(getattr(policy, "predict", None)):
        raise BadConfig("method", name, f"gives a {type(policy).__name__} without a method predict")
    return cast(Policy, policy)
