"""Runs that are killed, cut, split or mixed up end with the same table, or are refused."""

from __future__ import annotations

import json
from dataclasses import replace

import pytest
import soak
from helpers import killed_runs as killed_module
from helpers.example_records import some
from helpers.fake_runs import ONE_CELL, completed, dispatcher, grid_in
from helpers.killed_runs import cost_of, fake_onedemo, killed_runs

from onedemo.bench.episodes.episode_records import FILE, RecordWriter, read_records
from onedemo.bench.episodes.run_folder import Shard, gather, parsed_shard, recorded, table_hash
from onedemo.bench.episodes.scenarios import check_mergeable, read_suite
from onedemo.bench.run.finish import report
from onedemo.configs.errors import BadConfig


def test_a_run_that_is_killed_at_any_moment_loses_no_finished_episode(tmp_path):
    """`make soak` kills fifty times: bench/soak.json."""
    found = killed_runs(tmp_path, 5, 0)
    assert found["same_table"] and found["kills"] == 5
    assert found["in_the_middle"] > 0, "whatever was written, it was never killed while writing"
    assert (found["lost"], found["twice"], found["damaged"]) == (0, 0, 0)


def test_what_a_kill_has_cost_is_counted():
    one, two, three = some(3)
    assert cost_of(set(), [one, two], []) == {"in_the_middle": 1, "lost": 0, "twice": 0, "damaged": 0}
    assert cost_of({one.key, two.key}, [two, three, two], [4]) == {
        "in_the_middle": 0, "lost": 1, "twice": 1, "damaged": 1,
    }  # fmt: skip
    assert cost_of(set(), some(48), [])["in_the_middle"] == 0, "it was finished"


def test_kills_are_recorded_beside_what_was_measured_before(tmp_path, monkeypatch, capsys):
    file = tmp_path / "soak.json"
    file.write_text(json.dumps({"guard": {"steps": 7}}))
    found = {"kills": 50, "in_the_middle": 20, "lost": 0, "twice": 0, "damaged": 0, "same_table": True}
    monkeypatch.setattr(killed_module, "killed_runs", lambda folder, kills, seed: {**found, "kills": kills})
    assert soak.main(["--kills", "50", "--seed", "3", "--output", str(file)]) == 0
    values = json.loads(file.read_text())
    assert values["guard"] == {"steps": 7}
    assert (values["kills"]["kills"], values["kills"]["seed"], values["kills"]["lost"]) == (50, 3, 0)
    assert "numpy" in values["kills"]["versions"] and len(values["kills"]["bench_sha256"]) == 64
    found["lost"] = 1
    assert soak.main(["--kills", "50", "--output", str(file)]) == 1
    capsys.readouterr()


def test_a_file_cut_at_every_byte_of_its_last_three_lines_heals_to_the_same_table(tmp_path):
    grid = grid_in(tmp_path, ONE_CELL)
    folder = tmp_path / "run"
    records = completed(grid, folder, dispatcher())
    suite, reference = read_suite(folder), table_hash(records.values())
    whole = (folder / FILE).read_bytes()
    lines = whole.splitlines(keepends=True)
    by_key = {record.key: record for record in records.values()}
    for cut in range(len(b"".join(lines[:-3])), len(whole) + 1):
        (folder / FILE).write_bytes(whole[:cut])
        found, notes = recorded(folder, grid.cells, suite)
        complete = whole[:cut].count(b"\n")
        assert len(found) == complete
        torn = cut > 0 and whole[cut - 1 : cut] != b"\n"
        assert [f"line {complete + 1}: torn" in note for note in notes] == [True] * torn
        writer = RecordWriter(folder / FILE)
        for key in sorted(set(by_key) - set(found)):
            writer.append(by_key[key])
        writer.close()
        healed, notes = recorded(folder, grid.cells, suite)
        assert (table_hash(healed.values()), notes) == (reference, [])


def test_a_run_goes_on_after_a_cut(tmp_path, capsys):
    grid = grid_in(tmp_path)
    folder = tmp_path / "run"
    reference = table_hash(completed(grid, folder, dispatcher()).values())
    whole = (folder / FILE).read_bytes()
    (folder / FILE).write_bytes(whole[:-30])
    capsys.readouterr()
    assert table_hash(completed(grid, folder, dispatcher()).values()) == reference
    err = capsys.readouterr().err
    assert "line 48: torn, its episode is run again" in err
    assert "47 of 48 episodes were done before" in err


def test_lines_of_others_are_named_and_skipped(tmp_path, capsys):
    grid = grid_in(tmp_path)
    folder = tmp_path / "run"
    records = list(completed(grid, folder, dispatcher()).values())
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    (folder / FILE).write_bytes(b"".join([*lines[:3], b"hello\n", *lines[4:]]))
    writer = RecordWriter(folder / FILE)
    writer.append(replace(records[0], cell="0" * 12, success=False))
    writer.append(replace(records[0], scenario="0" * 12, success=False))
    writer.close()
    capsys.readouterr()
    assert table_hash(completed(grid, folder, dispatcher()).values()) == table_hash(records)
    err = capsys.readouterr().err
    assert "line 4: not an episode record, skipped" in err
    assert "line 49: an episode of another run, skipped" in err
    assert "line 50: an episode of another run, skipped" in err


def test_parts_make_the_whole(tmp_path):
    grid = grid_in(tmp_path)
    reference = completed(grid, tmp_path / "whole", dispatcher())
    folder = tmp_path / "run"
    for index in (3, 1, 2):
        completed(grid, folder, dispatcher(), Shard(index, 3))
    assert sorted(file.name for file in folder.glob("episodes*")) == [f"episodes.{k}-of-3.jsonl" for k in (1, 2, 3)]
    parts = [read_records(folder / f"episodes.{k}-of-3.jsonl")[0] for k in (1, 2, 3)]
    assert [len(part) for part in parts] == [16, 16, 16]
    gather(folder)
    merged, foreign = read_records(folder / FILE)
    assert foreign == []
    assert table_hash(merged) == table_hash(reference.values())
    assert [record.key for record in merged] == [
        (cell.digest(), index) for cell in grid.cells for index in range(12)
    ], "in the order of the cells"
    # what is there is not run again, however it is split
    assert len(completed(grid, folder, dispatcher(), Shard(1, 2))) == 48
    assert (folder / "episodes.1-of-2.jsonl").exists() is False


@pytest.mark.parametrize("text", ["0/2", "3/2", "1", "a/b", "1/0", "-1/2", "1/2/3", "1.5/2", ""])
def test_a_part_that_there_is_not_is_refused(text):
    with pytest.raises(BadConfig, match=r"--shard: .* is not i/n with i from 1 to n, like 2/4"):
        parsed_shard(text)


def test_the_last_part_reports(tmp_path):
    grid_in(tmp_path)
    for k in (1, 2):
        run = fake_onedemo(tmp_path, "--shard", f"{k}/2", "-o", "parts")
        out, err = run.communicate(timeout=120)
        assert run.returncode == 0, err
        said = "part 1 of 2 is done; missing of other parts: 24 episodes" in out
        assert said == (k == 1)
    (folder,) = (tmp_path / "parts").iterdir()
    assert (folder / "report.md").is_file()
    assert len(read_records(folder / FILE)[0]) == 48


def test_runs_on_different_scenarios_are_not_put_side_by_side(tmp_path):
    texts = ["method: screw\n", "settings: {trim: 0.03}\n", "seed: 5\n"]
    base = "name: one\ntask: stack\ndemonstration: stack\nepisodes: 3\nvideo: false\n"
    suites = {}
    for k, text in enumerate(texts):
        folder = tmp_path / str(k)
        completed(grid_in(tmp_path, base + text), folder, dispatcher(1))
        suites[folder] = read_suite(folder)
    same = {key: suites[key] for key in list(suites)[:2]}
    check_mergeable(same)
    with pytest.raises(BadConfig, match=r"2.scenarios\.json: suite: .* they cannot be compared"):
        check_mergeable(suites)


def test_a_folder_keeps_its_config_and_its_scenarios(tmp_path):
    grid = grid_in(tmp_path)
    folder = tmp_path / "run"
    completed(grid, folder, dispatcher())
    other = grid_in(tmp_path, "name: other\ntask: stack\ndemonstration: stack\nepisodes: 3\n")
    with pytest.raises(BadConfig, match=r"cells\.json: run: the folder belongs to another config"):
        completed(other, folder, dispatcher())
    file = folder / "scenarios.json"
    text = file.read_text()
    for changed, message in [
        (text.replace('"x":[0.1]', '"x":[0.2]', 1), "suite: is not the hash of the scenarios"),
        (text.replace('"version": 1', '"version": 7'), "version: is 7; known: 1"),
        (text[:-20], "is not a list of scenarios"),
    ]:
        assert changed != text
        file.write_text(changed)
        with pytest.raises(BadConfig, match=message):
            completed(grid, folder, dispatcher())


def test_a_report_is_made_of_the_folder_alone(tmp_path):
    grid = grid_in(tmp_path)
    records = completed(grid, tmp_path / "run", dispatcher())
    lines = report(tmp_path / "run")
    text = (tmp_path / "run" / "report.md").read_text()
    assert table_hash(records.values()) in text
    for cell in grid.cells:
        assert f"| {cell.task} {cell.level} | screw trim={cell.settings['trim']} | 12 |" in text
        assert any(line.startswith(f"{grid.label(cell)}: ") for line in lines)
    assert len([line for line in lines if not line.startswith("  ")]) == 7
    with pytest.raises(BadConfig, match="is this a run folder"):
        report(tmp_path)
