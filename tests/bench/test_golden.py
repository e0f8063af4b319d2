"""Run folders of every version are read for ever."""

from __future__ import annotations

import json
from dataclasses import asdict
from pathlib import Path

import pytest
from helpers.example_records import RECORD

from onedemo.bench.episodes import episode_records as record_lines
from onedemo.bench.episodes.episode_records import decoded, encoded, known_record, read_records
from onedemo.bench.episodes.run_folder import read_cells, recorded
from onedemo.bench.episodes.scenarios import read_suite

GOLDEN = Path(__file__).parent / "golden"


def test_a_run_folder_of_the_first_version_is_read(tmp_path):
    folder = GOLDEN / "run-1"
    run, labeled = read_cells(folder)
    ((label, cell),) = labeled
    assert (run, label) == ("17fe1b3967a5", "stack Panda L4 screw")
    suite = read_suite(folder)
    assert suite.hash.startswith(json.loads((folder / "scenarios.json").read_text())["suite"][:12])
    found, notes = recorded(folder, [cell], suite)
    assert notes == []
    lines = [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]
    assert {line["format"] for line in lines} == {1}
    for line in lines:
        body = line["record"]
        record = asdict(found[body["cell"], body["index"]])
        assert {key: record[key] for key in body} == body
    first = found[cell.digest(), 0]
    assert (first.success, first.level, first.seconds > 20) == (True, "L4", True)


def test_the_digest_of_a_cell_stays_what_it_was():
    """Records are known by it."""
    values = json.loads((GOLDEN / "run-1" / "cells.json").read_text())["cells"][0]
    ((_, cell),) = read_cells(GOLDEN / "run-1")[1]
    assert cell.digest() == values["digest"]
    assert cell.model_dump(mode="json") == values["config"]


def test_a_line_of_another_format_is_foreign(tmp_path, monkeypatch):
    monkeypatch.setattr(record_lines, "FORMAT", 2)
    line = encoded(RECORD)
    monkeypatch.undo()
    assert decoded(line) is None
    file = tmp_path / "episodes.jsonl"
    file.write_bytes(encoded(RECORD) + line)
    assert read_records(file) == ([RECORD], [2])


def test_a_record_without_a_later_key_has_its_default_and_one_without_an_earlier_key_is_none():
    values = asdict(RECORD)
    del values["scenario"]
    assert known_record(values) == RECORD
    for key in ("seed", "numbers"):
        with pytest.raises(ValueError, match=key):
            known_record({name: value for name, value in values.items() if name != key})
    with pytest.raises(ValueError, match="colour"):
        known_record({**values, "colour": "red"})
