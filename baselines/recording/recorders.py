"""Scripted demonstrations by task."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ...planner import Demonstration
from .record_pour import record_pour
from .record_shelve import SCENE, record_shelve


class Recorder(NamedTuple):
    """Recorder of a demonstration.

    Attributes:
        record: takes the task's environment, unwrapped, and returns the demonstration recorded in it.
        scene: arguments of that environment.
    """

    record: Callable[[Any], Demonstration]
    scene: Mapping[str, Any] = {}


RECORDERS = {"pour": Recorder(record_pour), "shelve": Recorder(record_shelve, SCENE)}
"""Recorder of each scripted task."""
