"""Workers that die, hang, or outlive their parent; tables that do not depend on who made them."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from helpers.fake_runs import ONE_CELL, completed, dispatcher, grid_in
from helpers.fake_worker import fake_record

from onedemo.bench.episodes.run_folder import table_hash
from onedemo.bench.workers.dispatcher import HUNG, WORKER_DIED, Dispatcher, WorkerFailed
from onedemo.bench.workers.processes import Processes

SCRIPT = Path(__file__).parents[2] / "helpers" / "fake_runs.py"


def told(monkeypatch, tmp_path, **what):
    marks = tmp_path / "marks"
    marks.mkdir(exist_ok=True)
    monkeypatch.setenv("FAKE", json.dumps({"marks": str(marks), **what}))


def expected(grid):
    return {(cell.digest(), k): fake_record(cell, k, "").numbers for cell in grid.cells for k in range(cell.episodes)}


@pytest.mark.parametrize("workers", [1, 2, 5])
def test_every_episode_is_run_once_and_the_table_is_the_same(workers, tmp_path):
    grid = grid_in(tmp_path)
    records = completed(grid, tmp_path / "run", dispatcher(workers))
    assert {key: record.numbers for key, record in records.items()} == expected(grid)
    lines = (tmp_path / "run" / "episodes.jsonl").read_bytes().splitlines()
    assert len(lines) == len(records) == 48
    again = completed(grid, tmp_path / "other", dispatcher(1))
    assert table_hash(again.values()) == table_hash(records.values())
    assert any(again[key].tick_us != records[key].tick_us for key in again)


@pytest.mark.parametrize("fault", ["die", "stop", "endless"])
def test_a_worker_that_dies_or_hangs_once_costs_one_retry(fault, tmp_path, monkeypatch):
    grid = grid_in(tmp_path)
    told(monkeypatch, tmp_path, faults={"3": [fault, 1], "7": [fault, 1]})
    records = completed(grid, tmp_path / "run", dispatcher(2, 1.5))
    assert {key: record.numbers for key, record in records.items()} == expected(grid)
    assert len(list((tmp_path / "marks").iterdir())) == 2


@pytest.mark.parametrize("fault, reason", [("die", WORKER_DIED), ("stop", HUNG), ("endless", HUNG)])
def test_a_second_time_is_a_record_that_says_so(fault, reason, tmp_path, monkeypatch, capsys):
    grid = grid_in(tmp_path, ONE_CELL)
    told(monkeypatch, tmp_path, faults={"5": [fault, 2]})
    records = completed(grid, tmp_path / "run", dispatcher(2, 1.0))
    assert len(records) == 12
    lost = [record for record in records.values() if record.failure_reason]
    (record,) = lost
    assert (record.index, record.failure_reason, record.success, record.safe) == (5, reason, False, False)
    assert "twice" in record.detail
    assert "twice; see workers.log" in capsys.readouterr().err
    assert (record.cell, record.scenario) != ("", "")
    assert completed(grid, tmp_path / "run", dispatcher(2)) == records, "it is a finished episode: not run again"
    again = completed(grid, tmp_path / "run", dispatcher(2), retry=True)
    assert {key: each.numbers for key, each in again.items()} == expected(grid)
    assert completed(grid, tmp_path / "run", dispatcher(2)) == again, "the better one counts"
    assert len((tmp_path / "run" / "episodes.jsonl").read_bytes().splitlines()) == 13


def test_a_worker_that_cannot_work_ends_the_run_in_one_line(tmp_path, monkeypatch):
    grid = grid_in(tmp_path)
    broken = Dispatcher(Processes((sys.executable, "-c", "raise SystemExit(1)")), 2, 5.0)
    with pytest.raises(WorkerFailed, match="worker died twice, in the cell stack Panda L1 screw"):
        completed(grid, tmp_path / "run", broken)
    told(monkeypatch, tmp_path, faults={"4": ["raise", 1]})
    with pytest.raises(WorkerFailed, match=r"workers\.log: ValueError: a mistake, in the cell"):
        completed(grid, tmp_path / "run", dispatcher(2, log=tmp_path / "log"))
    assert "Traceback" in (tmp_path / "log").read_text()


def children(process):
    return [int(each) for each in Path(f"/proc/{process}/task/{process}/children").read_text().split()]


def gone(process):
    """Whether a process has ended, be it that nobody has asked for its exit code yet."""
    try:
        return Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()[0] in "ZX"
    except OSError:
        return True


def wait_for(what, seconds=60.0):
    deadline = time.monotonic() + seconds
    while not what():
        assert time.monotonic() < deadline
        time.sleep(0.02)


@pytest.mark.parametrize("ending", [signal.SIGKILL, signal.SIGTERM, signal.SIGINT])
def test_no_worker_outlives_its_parent_not_even_a_stopped_one(ending, tmp_path):
    grid_in(tmp_path)
    run = [sys.executable, str(SCRIPT), "run", "grid.yaml", "episodes=5000", "workers=2", "-q"]
    heard = {"preexec_fn": lambda: signal.signal(signal.SIGINT, signal.default_int_handler)}
    fake = {**os.environ, "FAKE": json.dumps({"pause": 0.01})}
    parent = subprocess.Popen(run, cwd=tmp_path, env=fake, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, **heard)
    wait_for(lambda: any(file.stat().st_size for file in tmp_path.glob("runs/*/episodes.jsonl")))
    workers = children(parent.pid)
    assert len(workers) == 2
    os.kill(workers[0], signal.SIGSTOP)
    os.kill(parent.pid, ending)
    parent.wait(timeout=30)
    wait_for(lambda: all(gone(worker) for worker in workers), 10.0)
    said = parent.stderr.read().decode()
    assert "Traceback" not in said
    assert parent.returncode == (130 if ending == signal.SIGINT else -ending)


def test_a_worker_has_one_thread_per_library_and_prints_into_the_log(tmp_path):
    code = (
        "import os; from onedemo.bench.workers.worker_process import main\n"
        "class Shop:\n    def do(self, job):\n        print('hello'); os.system('echo from a child')\n"
        "        return {key: os.environ[key] for key in os.environ if key.endswith('_NUM_THREADS')}\n"
        "main(Shop())"
    )
    log = tmp_path / "log"
    with Dispatcher(Processes((sys.executable, "-c", code), log), 1, 30.0) as executor:
        (outcome,) = executor.results([{"kind": "prepare", "cell": {}}])
    assert {"OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"} <= set(outcome.answer)
    assert set(outcome.answer.values()) == {"1"}
    assert "hello" in log.read_text() and "from a child" in log.read_text()
