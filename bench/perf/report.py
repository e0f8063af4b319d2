"""Cost of a large report: CPU time and memory."""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Callable
from functools import cache
from tempfile import TemporaryDirectory

from .measuring import Row, row

EPISODES = 10_000
"""Number of episodes in the report."""
SECONDS = "report of 10 000 episodes, CPU time"
MEMORY = "memory for a report of 10 000 episodes"
_CODE = """
import resource, sys, time
from pathlib import Path
from onedemo.bench.episodes.synthetic_runs import LEVELS, METHODS, write_synthetic_run
tasks = ("stack", "pour", "shelve", "bimanual_pour")
cells = len(tasks) * len(LEVELS) * len(METHODS)
folder = write_synthetic_run(Path(sys.argv[1]), -(-int(sys.argv[2]) // cells), tasks=tasks)
begun, cpu = time.perf_counter(), time.process_time()
from onedemo.bench.report.report import write_report
write_report(folder)
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
print(time.process_time() - cpu, time.perf_counter() - begun, peak)
"""


@cache
def _measured() -> tuple[float, float, float]:
    """Return CPU time [s], elapsed time [s] and peak memory [MB] of a process that writes a report."""
    with TemporaryDirectory() as folder:
        command = [sys.executable, "-c", _CODE, folder, str(EPISODES)]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
    cpu, seconds, megabytes = (float(word) for word in done.stdout.split()[-3:])
    return cpu, seconds, megabytes


def _seconds() -> Row:
    cpu, seconds, _ = _measured()
    note = f"{seconds:.1f} s by the clock, on one core; of drawn numbers, 4 tasks, 4 levels, 6 methods, 20 figures"
    return row(SECONDS, cpu, "s", 20.0, note)


def _memory() -> Row:
    return row(MEMORY, _measured()[2], "MB", 1000.0, "peak of the process, drawing the numbers included")


REPORT_LINES: dict[str, Callable[[], Row]] = {SECONDS: _seconds, MEMORY: _memory}
"""Measurements by name."""
