"""No call writes or reads outside an array, whatever is handed in and however long: in processes that may crash."""

from __future__ import annotations

import importlib.util
import os
import re
import subprocess
import sys
from functools import cache
from pathlib import Path

import pytest

from onedemo import planner

HERE = Path(__file__).parent
spec = importlib.util.spec_from_file_location("memory_cases", HERE / "memory_cases.py")
memory_cases = importlib.util.module_from_spec(spec)
spec.loader.exec_module(memory_cases)
CASES, NO_ARRAYS = memory_cases.CASES, memory_cases.NO_ARRAYS
KERNELS = ("collision", "control", "escape", "geometry", "planning/test_refine.py", "reactive", "safety")
"""Tests that run every kernel."""


def ran(script: str, *words: str, **environment: str) -> list[str]:
    """The lines of a script of this folder, which must end by itself."""
    call = [sys.executable, "-X", "faulthandler", str(HERE / script), *words]
    done = subprocess.run(call, capture_output=True, text=True, env={**os.environ, **environment}, cwd=HERE)
    assert done.returncode == 0, (done.stdout[-300:], done.stderr[-3000:])
    return done.stdout.splitlines()


@cache
def outcomes() -> list[str]:
    return ran("memory_cases.py")


def unfit(lines: list[str], entry: str) -> list[str]:
    """Outcomes of an entry that are neither one line of refusal nor the right answer."""
    mine = [line for line in lines if line.startswith(f"{entry} / ")]
    assert len(mine) > 10
    return [line for line in mine if not re.search(r": (same|refused \w+: .+)$", line)]


def test_every_public_name_is_tried_or_takes_no_array():
    assert set(planner.__all__) == (set(CASES) - {"others"}) | NO_ARRAYS
    assert not set(CASES) & NO_ARRAYS


@pytest.mark.parametrize("entry", CASES)
def test_wrong_arrays_are_refused_and_unusual_ones_are_right(entry):
    assert unfit(outcomes(), entry) == []
    assert f"{entry} status 0" in outcomes()


def test_demonstrations_of_any_length_are_planned():
    *lines, last = ran("long_paths.py")
    assert last == "ended" and len(lines) == 13
    assert lines.pop() == "a reactive planner along 5000 poses: done"
    for line in lines:
        assert " sound, " in line, line
    detours = [line for line in lines if "a ball in the way" in line]
    assert len(detours) == 5 and all(": escape sound" in line for line in detours)


@pytest.mark.slow
def test_with_checks_of_bounds_no_kernel_leaves_its_arrays(tmp_path):
    """numba raises IndexError then; such kernels have a cache of their own."""
    checked = {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": str(tmp_path)}
    short = "from memory_cases import *; from onedemo.planner.control.arm_arrays import arm_arrays, pose_at\n"
    call = [sys.executable, "-c", short + "pose_at(arm_arrays(ARM), HOME[:3])"]
    done = subprocess.run(call, capture_output=True, text=True, env={**os.environ, **checked}, cwd=HERE)
    assert "IndexError" in done.stderr, "indices are not checked"
    lines = ran("memory_cases.py", **checked)
    assert [line for entry in CASES for line in unfit(lines, entry)] == []
    assert ran("long_paths.py", **checked)[-1] == "ended"
    call = [sys.executable, "-m", "pytest", "-x", "-q", "-n", "0", "-p", "no:cacheprovider", "-m", "not slow"]
    done = subprocess.run(
        [*call, *(str(HERE / name) for name in KERNELS)],
        capture_output=True, text=True, env={**os.environ, **checked}, cwd=HERE.parents[1],
    )  # fmt: skip
    assert done.returncode == 0, done.stdout[-5000:]
