"""The scripted demonstrations by task."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

from ...planner.imitation.demonstration import Demonstration
from .record_pour import record_pour
from .record_shelve import SCENE, record_shelve


class Recorder(NamedTuple):
    """How a demonstration is made.

    Attributes:
        record: takes the environment of the task, unwrapped, and gives the demonstration in it.
        scene: arguments of that environment.
    """

    record: Callable[[Any], Demonstration]
    scene: Mapping[str, Any] = {}


RECORDERS = {"pour": Recorder(record_pour), "shelve": Recorder(record_shelve, SCENE)}
