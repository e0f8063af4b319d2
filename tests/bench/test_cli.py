"""The command as users meet it: exit codes, one line per error, runs that go on."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from onedemo.bench.cli import main
from onedemo.bench.records import read_records
from onedemo.configs.shipped import shipped_demonstration
from onedemo.planner.demo_io import load_demonstration, save_demonstration

ENTRY = "import sys; from onedemo.bench.cli import main; main()"


def onedemo(*arguments, **options):
    run = [sys.executable, "-c", ENTRY, *map(str, arguments)]
    return subprocess.run(run, capture_output=True, text=True, timeout=300, **options)


def called(monkeypatch, capsys, *arguments):
    """Exit code, standard output and error of the command in this process."""
    monkeypatch.setattr(sys, "argv", ["onedemo", *map(str, arguments)])
    with pytest.raises(SystemExit) as stopped:
        main()
    said = capsys.readouterr()
    return stopped.value.code, said.out, said.err


@pytest.mark.parametrize("command", [[], ["run"], ["demo"], ["demo", "check"], ["demo", "import"], ["perf"]])
def test_every_command_explains_itself(command, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = called(monkeypatch, capsys, *command, "--help")
    assert code == 0
    assert "Usage: onedemo" in out
    assert max(map(len, out.splitlines())) <= 80


def test_help_loads_nothing_heavy():
    code = f"import sys; sys.argv = ['onedemo', '--help']\ntry:\n    {ENTRY[12:]}\nfinally:\n    print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60).stdout
    assert not {"numba", "mujoco", "robosuite", "scipy", "matplotlib"} & set(out.split())


def test_a_demonstration_is_summed_up_for_a_reader(monkeypatch, capsys):
    code, out, _ = called(monkeypatch, capsys, "demo", "check", "stack")
    assert code == 0
    for word in ("26.55 s", "approach", "transfer", "screw:", "units", "teleoperated", "MIT", "warning"):
        assert word in out


def test_names_in_a_file_are_never_taken_for_markup(monkeypatch, capsys, tmp_path):
    demo = load_demonstration(shipped_demonstration("stack"))
    save_demonstration(dataclasses.replace(demo, name="[/red] [bold]x", licence="[link=x]y"), tmp_path / "odd.npz")
    code, out, _ = called(monkeypatch, capsys, "demo", "check", tmp_path / "odd.npz")
    assert code == 0
    assert "[/red] [bold]x" in out
    assert "[link=x]y" in out


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["demo", "check", "missing.npz"], "missing.npz: file: does not exist"),
        (["demo", "check", "nothing"], "unknown demonstration 'nothing'; known: stack"),
        (["demo", "import", "none.csv", "-o", "x.npz", "--rate", "10"], "none.csv: file: does not exist"),
        (["run", "nothing"], "unknown config 'nothing'; known: stack"),
        (["run", "none.yaml"], "unknown config 'none'; known: stack"),
        (["run", "some/none.yaml"], "some/none.yaml: no such file"),
        (["run", "stack", "episods=3"], "command line: episods: unknown key; did you mean 'episodes'?"),
        (["run", "stack", "task=juggle"], "task: unknown task 'juggle'; known: stack"),
        (["run", "stack", "level=L9"], "level: unknown level 'L9'; known: L0, L1, L2"),
        (["run", "stack", "robot=R2D2"], "robot: unknown robot 'R2D2'; known: Panda"),
        (["run", "stack", "method=magic"], "method: unknown method 'magic'; known: screw"),
        (["run", "stack", "demonstration=x"], "unknown demonstration 'x'; known: stack"),
        (["run", "stack", "demonstration=x.npz"], "x.npz: file: does not exist"),
        (["run", "stack", "settings.motion.guid=1", "episodes=1"], "motion.guid: unknown key; allowed: guide"),
        (["run", "stack", "settings.motion.guide=2", "episodes=1"], "guide"),
        (["run", "stack", "settings.trim=soon", "episodes=1"], "trim"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(arguments, message, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    code, out, err = called(monkeypatch, capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err


def test_a_run_leaves_everything_and_goes_on_where_it_stopped(tmp_path):
    first = onedemo("run", "stack", "episodes=2", "video=false", "-o", tmp_path, "--quiet")
    assert first.returncode == 0, first.stderr
    folder = Path(first.stdout.strip())
    assert first.stdout == f"{folder}\n", "quiet prints the folder alone"
    assert {"episodes.jsonl", "report.md", "summary.json", "config.yaml", "environment.json", "scenarios.json"} <= {
        path.name for path in folder.iterdir()
    }
    row = json.loads((folder / "summary.json").read_text())["rows"][0]
    assert (row["episodes"], row["successes"]) == (2, 2)
    before = (folder / "episodes.jsonl").read_bytes()
    lines = before.splitlines(keepends=True)
    (folder / "episodes.jsonl").write_bytes(lines[0] + lines[1][:40])
    again = onedemo("run", "stack", "episodes=2", "video=false", "-o", tmp_path)
    assert again.returncode == 0, again.stderr
    assert again.stdout.strip().splitlines()[-1] == str(folder)
    assert "1 of 2 episodes were done before" in again.stderr
    healed = read_records(folder / "episodes.jsonl")[0]
    assert [record.index for record in healed] == [0, 1]
    assert (folder / "episodes.jsonl").read_bytes().startswith(lines[0])


def test_control_c_keeps_finished_episodes(tmp_path):
    run = [sys.executable, "-c", ENTRY, "run", "stack", "episodes=500", "video=false", "-o", str(tmp_path)]
    process = subprocess.Popen(run, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    deadline = time.monotonic() + 120
    while not any(file.stat().st_size for file in tmp_path.glob("*/episodes.jsonl")):
        assert process.poll() is None
        assert time.monotonic() < deadline
        time.sleep(0.1)
    os.kill(process.pid, signal.SIGINT)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 130
    assert "finished episodes are kept" in err
    assert "Traceback" not in err
    (file,) = tmp_path.glob("*/episodes.jsonl")
    records, foreign = read_records(file)
    assert len(records) >= 1
    assert foreign == []
