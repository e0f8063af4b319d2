"""Runs without a simulator that are killed at any moment and gone on with: what is lost."""

from __future__ import annotations

import json
import os
import random
import shutil
import signal
import subprocess
import sys
import time
from collections import Counter
from pathlib import Path
from typing import Any

from helpers.fake_runs import grid_in

from onedemo.bench.episodes.episode_records import FILE, read_records
from onedemo.bench.episodes.run_folder import read_cells, recorded, table_hash
from onedemo.bench.episodes.scenarios import read_suite

SCRIPT = Path(__file__).with_name("fake_runs.py")
EPISODES = 48
LATE = 40
"""Episodes at whose end a run is killed at the latest, so that it is not over before it hears of it."""
PAUSE = 0.02
"""Seconds that an episode takes."""
STARTING = 5
"""One kill of so many comes while the run is starting."""


def fake_onedemo(folder, *arguments, **options):
    """`onedemo run` of the grid in a folder, as a process of its own."""
    run = [sys.executable, str(SCRIPT), "run", "grid.yaml", *arguments]
    fake = {**os.environ, "FAKE": json.dumps({"pause": PAUSE})}
    return subprocess.Popen(run, cwd=folder, env=fake, text=True, stdout=-1, stderr=-1, **options)


def table_of(folder):
    """Hash of all results, and how many lines hold a record."""
    _, labeled = read_cells(folder)
    cells = [cell for _, cell in labeled]
    records, _ = recorded(folder, cells, read_suite(folder))
    return table_hash(records.values()), len(records)


def summary_of(folder):
    """The rows of the summary, without times."""
    rows = json.loads((folder / "summary.json").read_text())["rows"]
    return [{key: value for key, value in row.items() if not key.startswith("tick_us")} for row in rows]


def killed_runs(folder: Path, kills: int, seed: int) -> dict[str, Any]:
    """Kill a run so many times, each time going on with it; what came of it.

    Args:
        folder: an empty one.
        kills: how often; a run that is finished is begun anew.
        seed: of the moments.
    """
    grid_in(folder)
    begun = time.monotonic()
    whole = fake_onedemo(folder, "-q", "-o", "whole")
    errors = whole.communicate(timeout=600)[1]
    seconds = time.monotonic() - begun
    (reference,) = (folder / "whole").iterdir()
    tally, draw, before = Counter(cost_of(set(), [], [])), random.Random(seed), set()
    for kill in range(kills):
        run = fake_onedemo(folder, "-q")
        if kill % STARTING == STARTING - 1:
            time.sleep(draw.uniform(0.0, 0.8) * seconds)
        else:
            _wait_for(draw.randint(len(before) + 1, max(LATE, len(before) + 1)), folder, run)
            time.sleep(draw.uniform(0.0, 2.0 * PAUSE))
        run.send_signal(signal.SIGKILL)
        run.communicate(timeout=600)
        files = list(folder.glob(f"runs/*/{FILE}"))
        records, foreign = read_records(files[0]) if files else ([], [])
        tally.update(kills=1, **cost_of(before, records, foreign))
        before = {record.key for record in records}
        if len(before) == EPISODES:
            shutil.rmtree(folder / "runs")
            before = set()
    last = fake_onedemo(folder, "-q").wait(timeout=600)
    (finished,) = (folder / "runs").iterdir()
    same = table_of(finished) == table_of(reference) == (table_of(reference)[0], EPISODES)
    done = errors == "" and last == 0 and summary_of(finished) == summary_of(reference)
    return {**tally, "same_table": bool(same and done)}


def _wait_for(episodes: int, folder: Path, run: subprocess.Popen) -> None:
    """Until so many episodes are written, or the run is over."""
    written = 0
    while run.poll() is None and written < episodes:
        time.sleep(0.001)
        written = sum(file.read_bytes().count(b"\n") for file in folder.glob(f"runs/*/{FILE}"))


def cost_of(before: set, records: list, foreign: list) -> dict[str, int]:
    """What is found at a kill.

    Args:
        before: keys of the episodes that were finished at the last one.
        records: of all that are finished.
        foreign: numbers of lines that hold no record.
    """
    keys = {record.key for record in records}
    return {
        "in_the_middle": int(len(before) < len(keys) < EPISODES),
        "lost": len(before - keys),
        "twice": len(records) - len(keys),
        "damaged": len(foreign),
    }
