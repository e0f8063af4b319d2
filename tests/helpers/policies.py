"""Policies as parameters of tests: those whose optional library is missing are skipped, with the reason."""

from __future__ import annotations

from importlib.util import find_spec

import pytest

from onedemo.baselines.factory import POLICIES
from onedemo.baselines.motion.settings import ProgramSettings

LIBRARIES = {"dmp-goal": "movement_primitives", "dmp-world": "movement_primitives", "rrt": "ompl"}
PROGRAMS = sorted(name for name, kind in POLICIES.items() if issubclass(kind.settings, ProgramSettings))
"""Those that run the task's program; the others are learned."""
LEARNED = sorted(set(POLICIES) - set(PROGRAMS))


def installed(*names: str) -> list:
    """The names as parameters."""
    missing = {name for name, library in LIBRARIES.items() if find_spec(library) is None}
    return [
        pytest.param(name, marks=pytest.mark.skipif(name in missing, reason=f"needs {LIBRARIES.get(name)}"))
        for name in names
    ]
