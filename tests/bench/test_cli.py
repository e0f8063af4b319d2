"""The command as users meet it: exit codes, one line per error, runs that go on."""

from __future__ import annotations

import dataclasses
import json
import os
import signal
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import pytest

from onedemo.bench.cli import main
from onedemo.bench.episodes.episode_records import read_records
from onedemo.bench.perf import command as perf
from onedemo.bench.perf.tasks import OWN, step_line
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.imitation.demonstration_files import read_demonstration, save_demonstration

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


@pytest.mark.parametrize(
    "command",
    [
        [],
        ["run"],
        ["report"],
        ["plan"],
        ["reproduce"],
        ["demo"],
        ["demo", "check"],
        ["demo", "import"],
        ["robot"],
        ["robot", "check"],
        ["perf"],
    ],
)
def test_every_command_explains_itself(command, monkeypatch, capsys):
    monkeypatch.setenv("COLUMNS", "80")
    code, out, _ = called(monkeypatch, capsys, *command, "--help")
    assert code == 0
    assert "Usage: onedemo" in out
    assert max(map(len, out.splitlines())) <= 80


def test_help_loads_nothing_heavy():
    code = f"import sys; sys.argv = ['onedemo', '--help']\ntry:\n    {ENTRY[12:]}\nfinally:\n    print(*sys.modules)"
    out = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60).stdout
    assert not {"numpy", "numba", "mujoco", "robosuite", "scipy", "matplotlib"} & set(out.split())


def test_a_demonstration_is_summed_up_for_a_reader(monkeypatch, capsys):
    code, out, _ = called(monkeypatch, capsys, "demo", "check", "stack")
    assert code == 0
    for word in ("26.55 s", "approach", "transfer", "screw:", "units", "teleoperated", "MIT", "warning"):
        assert word in out


def test_names_in_a_file_are_never_taken_for_markup(monkeypatch, capsys, tmp_path):
    demo = read_demonstration(shipped_demonstration("stack"))
    save_demonstration(dataclasses.replace(demo, name="[/red] [bold]x", licence="[link=x]y"), tmp_path / "odd.npz")
    code, out, _ = called(monkeypatch, capsys, "demo", "check", tmp_path / "odd.npz")
    assert code == 0
    assert "[/red] [bold]x" in out
    assert "[link=x]y" in out


@pytest.mark.parametrize(
    "arguments, message",
    [
        (["demo", "check", "missing.npz"], "missing.npz: file: does not exist"),
        (["demo", "check", "nothing"], "unknown demonstration 'nothing'; known: lift, nut_assembly, pour"),
        (["demo", "record", "juggle", "-o", "x.npz"], "unknown scripted demonstration 'juggle'; known: pour, shelve"),
        (["demo", "import", "x.npy", "-o", "x.npz", "--task", "stack"], "x.npy: file: does not exist"),
        (["demo", "import", "none.csv", "-o", "x.npz", "--rate", "10"], "none.csv: file: does not exist"),
        (
            ["reproduce", "juggle"],
            "unknown experiment 'juggle'; known: pour, pour_obstacles, stack, shelve, shelve_one",
        ),
        (["reproduce", "--episodes", "0"], "--episodes"),
        (["run", "nothing"], "unknown config 'nothing'; known: bimanual_pour, compare, headline, "),
        (["run", "none.yaml"], "unknown config 'none'; known: bimanual_pour, compare, headline, "),
        (["run", "robosuite", "env.task=Lifft"], "and here env.task=Lifft is none of Lift, Stack, NutAssemblySquare"),
        (["run", "mine.py"], "mine.py: is no config; a task in it is mine:NAME"),
        (["run", "some/none.yaml"], "some/none.yaml: no such file"),
        (["run", "stack", "episods=3"], "command line: episods: unknown key; did you mean 'episodes'?"),
        (["run", "stack", "task=juggle"], "task: unknown task 'juggle'; known: stack, pour"),
        (["run", "stack", "level=L9"], "level: unknown level 'L9'; known: L0: the demonstration's own layout; L1: "),
        (["run", "stack", "robot=R2D2"], "robot: unknown robot 'R2D2'; known: Panda"),
        (["run", "stack", "method=magic"], "method: unknown method 'magic'; known: screw"),
        (["run", "stack", "demonstration=x"], "unknown demonstration 'x'; known: lift, nut_assembly, pour"),
        (["run", "stack", "demonstration=x.npz"], "x.npz: file: does not exist"),
        (
            ["run", "stack", "settings.motion.guid=1", "episodes=1"],
            "motion.guid: unknown key; did you mean 'guide'? allowed: guide",
        ),
        (["run", "stack", "settings.motion.guide=2", "episodes=1"], "guide"),
        (["run", "stack", "settings.trim=soon", "episodes=1"], "trim"),
        (["run", "stack", "level=L9"], "command line: level"),
        (["run", "stack", "--shard", "3/2"], "command line: --shard: '3/2' is not i/n with i from 1 to n, like 2/4"),
        (
            ["run", "stack", "env.blocks=3"],
            "command line: env.blocks: unknown key; did you mean 'n_blocks'? allowed: ",
        ),
        (["run", "stack", "sweep.level=[L1, L7]", "level=L8"], "command line: level: unknown level 'L8'"),
        (
            ["run", "headline", "sweep.task=[stack, juggle]", "method=screw"],
            "demonstration: is missing (in the cell tas",
        ),
        (["report", "nowhere"], "nowhere: is not a run folder: there is no such folder"),
        (["report", "a", "b"], "command line: --output: is needed where several runs are compared"),
        (["report"], "Missing argument 'RUN'; usage: onedemo report [OPTIONS]"),
        (["fly"], "No such command 'fly'; onedemo knows: run, train, curves, report, plan, reproduce, "),
        (["demo", "fly"], "No such command 'fly'; onedemo demo knows: check, skill, import"),
        (["--fast"], "No such option: --fast"),
        (["run"], "Missing argument 'config'; usage: onedemo run [OPTIONS]"),
        (
            ["run", "stack", "--fast"],
            "No such option: --fast; keys of a config are written without dashes: fast=...; usage: ",
        ),
        (["perf", "--only"], "Option '--only' requires an argument"),
        (["perf", "now"], "Got unexpected extra argument(s) (now); usage: onedemo perf"),
        (
            ["perf", "--only", "warp"],
            "unknown group or line of perf 'warp'; known: controller, planner, step, run, process, report",
        ),
        (["perf", "--json", "no/x.json"], "--json: no/x.json cannot be written: there is no folder no"),
        (["demo", "import", "x.csv"], "Missing option '--output' / '-o'; usage: onedemo demo import"),
        (["demo", "import", "x.csv", "-o", "y.npz", "--rate", "soon"], "Invalid value for '--rate'"),
        (["demo", "import", "x.csv", "-o", "no/x.npz"], "--output: no/x.npz cannot be written: there is no folder no"),
        (["demo", "import", "x.csv", "-o", "."], "--output: . does not end in .npz"),
        (["run", "stack", "-o", "a_file", "episodes=1"], "command line: --output: no run folder at a_file/stack-"),
    ],
)
def test_a_mistake_is_one_line_and_exit_code_2(arguments, message, monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("a_file").touch()
    code, out, err = called(monkeypatch, capsys, *arguments)
    assert (code, out) == (2, "")
    assert message in err
    assert len(err.strip().splitlines()) == 1
    assert "Traceback" not in err


def test_a_mistake_in_a_file_names_the_file_and_one_on_the_command_line_does_not(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    Path("mine.yaml").write_text("name: mine\ntask: stack\ndemonstration: stack\nlevel: L8\n")
    assert "mine.yaml: level: unknown level 'L8'" in called(monkeypatch, capsys, "run", "mine.yaml")[2]
    _, _, err = called(monkeypatch, capsys, "run", "mine.yaml", "level=L9")
    assert "command line: level: unknown level 'L9'" in err
    assert "mine.yaml" not in err


@pytest.mark.parametrize(
    "changes, message",
    [
        ({"task": "pour"}, "other.npz: task: is 'pour'; the task of this run is 'stack'"),
        ({"task": ""}, "other.npz: task: is ''; the task of this run is 'stack'"),
        ({"segments": ()}, "segment_names: 'approach' is missing; 'stack' needs approach, transfer, there are: none"),
        (
            {"segments": "approach"},
            "segment_names: 'transfer' is missing; 'stack' needs approach, transfer, there are: ",
        ),
    ],
)
def test_a_demonstration_of_something_else_is_refused_by_file_and_key(changes, message, monkeypatch, capsys, tmp_path):
    demo = read_demonstration(shipped_demonstration("stack"))
    if changes.get("segments"):
        changes = {"segments": demo.segments[:1]}
    save_demonstration(dataclasses.replace(demo, **changes), tmp_path / "other.npz")
    monkeypatch.chdir(tmp_path)
    code, out, err = called(monkeypatch, capsys, "run", "stack", "demonstration=other.npz")
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert message in err


def test_a_missing_library_of_opencv_is_one_line_that_says_what_to_install(monkeypatch, capsys, tmp_path):
    def missing(*_):
        raise ImportError("libGL.so.1: cannot open shared object file: No such file or directory")

    monkeypatch.setattr("onedemo.envs.core.environment.compiled_scene", missing)
    monkeypatch.chdir(tmp_path)
    code, out, err = called(monkeypatch, capsys, "run", "stack", "episodes=1", "executor=serial")
    assert (code, out, len(err.strip().splitlines())) == (2, "", 1)
    assert "the library libGL.so.1 is missing" in err
    assert "apt install libgl1 libglib2.0-0" in err

    def broken(*_):
        raise ImportError("cannot import name 'x'")

    monkeypatch.setattr("onedemo.envs.core.environment.compiled_scene", broken)
    monkeypatch.setattr(sys, "argv", ["onedemo", "run", "stack", "episodes=1", "executor=serial"])
    with pytest.raises(ImportError, match="cannot import name"):
        main()


def test_the_same_libraries_stand_in_readme_prerequisites_and_ci():
    root = Path(__file__).parents[2]
    for file in ("README.md", ".ci/prerequisites", ".ci/run"):
        text = (root / file).read_text(encoding="utf-8")
        assert "build-essential python3-dev python3-venv linux-libc-dev libgl1 libglib2.0-0" in text, file
    for file in ("README.md", ".ci/run"):
        assert "libegl1 libegl-mesa0 libgl1-mesa-dri" in (root / file).read_text(encoding="utf-8"), file


@pytest.mark.parametrize("missing", ["libGL.so.1", "libgthread-2.0.so.0"])
def test_the_prerequisites_name_a_missing_library_in_one_line(missing, tmp_path):
    fake = tmp_path / "python3"
    fake.write_text(f'#!/bin/sh\ncase "$*" in *CDLL*{missing}*) exit 1 ;; esac\nexec {sys.executable} "$@"\n')
    fake.chmod(0o755)
    check = Path(__file__).parents[2] / ".ci/prerequisites"
    done = subprocess.run(["sh", str(check), str(fake)], capture_output=True, text=True, timeout=60)
    assert done.returncode == 1
    (line,) = done.stderr.splitlines()
    assert missing in line
    assert "apt install" in line


def test_perf_runs_what_matches_and_nothing_else(monkeypatch, capsys, tmp_path):
    ran = []

    def measured(name):
        def measure():
            ran.append(name)
            return perf.row(name, 1.0, "ratio", 2.0, "a note")

        return measure

    lines = {group: {name: measured(name) for name in names} for group, names in perf.GROUPS.items()}
    monkeypatch.setattr(perf, "GROUPS", lines)
    file = tmp_path / "rows.json"
    assert called(monkeypatch, capsys, "perf", "--only", "stack step*", "--json", file)[0] == 0
    assert ran == [name for name in lines["step"] if "stack step" in name.lower()]
    assert step_line("stack") in ran and perf.PEER_STEP in ran
    rows = json.loads(file.read_text())["rows"]
    assert [(row["name"], row["value"], row["goal"], row["ok"]) for row in rows] == [(n, 1.0, 2.0, True) for n in ran]
    ran.clear()
    assert called(monkeypatch, capsys, "perf", "--only", "process")[0] == 0
    assert ran == [perf.MEMORY, perf.IMPORT, perf.START, perf.HELP]
    ran.clear()
    assert called(monkeypatch, capsys, "perf")[0] == 0
    long = list(perf.GROUPS[perf.LONG])
    assert len(long) == 18 and not set(long) & set(ran)
    ran.clear()
    assert called(monkeypatch, capsys, "perf", "--long", "--only", "ticks")[0] == 0
    assert ran == long


def test_a_file_that_cannot_be_written_after_all_is_one_line(monkeypatch, capsys, tmp_path):
    def full(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(perf, "write_json", full)
    monkeypatch.setattr(perf, "GROUPS", {"step": {"a line": lambda: perf.row("a line", 1.0, "ratio", 2.0)}})
    code, _, err = called(monkeypatch, capsys, "perf", "--json", tmp_path / "x.json")
    assert code == 2
    assert err.strip().endswith("x.json cannot be written: No space left on device")


@pytest.mark.parametrize("task", sorted(OWN))
def test_the_two_scenes_of_a_step_line_go_the_same_way(task):
    """The line itself fails if they do not; its value depends on the machine."""
    assert perf.GROUPS["step"][step_line(task)]().value > 0.5


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
    # what a shell starts in the background ignores SIGINT, and so would this
    heard = partial(signal.signal, signal.SIGINT, signal.default_int_handler)
    process = subprocess.Popen(run, stderr=subprocess.PIPE, stdout=subprocess.PIPE, text=True, preexec_fn=heard)
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


def test_a_comparison_runs_in_processes_and_is_not_run_again(tmp_path):
    config = tmp_path / "pair.yaml"
    config.write_text(
        "name: pair\ntask: stack\ndemonstration: stack\nepisodes: 2\nmax_seconds: 2\n"
        "sweep: {settings.motion.guide: [0.2, 0.5]}\n"
    )
    first = onedemo("run", config, "workers=2", "-o", tmp_path / "runs")
    assert first.returncode == 0, first.stderr
    folder = Path(first.stdout.strip().splitlines()[-1])
    assert "stack Panda L1 screw settings.motion.guide=0.2: 0 of 2 succeeded" in first.stdout
    assert "settings.motion.guide=0.5: 0 of 2 succeeded" in first.stderr, "a line for each cell when it is complete"
    lines = (folder / "episodes.jsonl").read_bytes()
    again = onedemo("run", folder / "config.yaml", "-o", tmp_path / "runs", "--quiet")
    assert (again.stdout, again.stderr) == (f"{folder}\n", ""), "the config in the folder is the config of the run"
    assert (folder / "episodes.jsonl").read_bytes() == lines


def test_the_schema_is_printed_for_editors(monkeypatch, capsys):
    code, out, _ = called(monkeypatch, capsys, "schema")
    assert code == 0
    assert "sweep" in json.loads(out)["properties"]
