"""Algorithm 1, one step per tick."""

from __future__ import annotations

import warnings
from typing import Any


def __getattr__(name: str) -> Any:
    """Give the name of the former module `planner.reactive` for one more version."""
    if name != "ReactivePlanner":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(f"{__name__}.{name} is now onedemo.planner.{name}", DeprecationWarning, stacklevel=2)
    from .reactive_planner import ReactivePlanner

    return ReactivePlanner
