"""The scripted demonstrations by task."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from ..planner.demo import Demonstration
from .record_pour import record_pour

RECORDERS: dict[str, Callable[[Any], Demonstration]] = {"pour": record_pour}
"""Each takes the environment of its task, unwrapped, and gives the demonstration in it."""
