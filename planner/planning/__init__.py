"""Plans: a demonstration, a start, a goal and obstacles in, joints for every tick out."""

from __future__ import annotations

import warnings
from typing import Any


def __getattr__(name: str) -> Any:
    """Give the names of the former module `planner.planning` for one more version."""
    if name not in ("Planner", "plan_batch"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(f"{__name__}.{name} is now onedemo.planner.{name}", DeprecationWarning, stacklevel=2)
    from .batch import plan_batch
    from .planner import Planner

    return {"Planner": Planner, "plan_batch": plan_batch}[name]
