"""Cells of a report: compared in pairs, where they were shown as much."""

from __future__ import annotations

import json
from dataclasses import replace

import numpy as np
import pytest
from helpers.example_runs import small_run

from onedemo.bench.episodes.episode_records import FILE, encoded, read_records
from onedemo.bench.episodes.scenarios import Suite, frozen, read_suite
from onedemo.bench.report.groups import groups_of, metric_tests, rank, success_tests
from onedemo.bench.report.read_runs import read_run
from onedemo.bench.report.report import write_report
from onedemo.bench.statistics import holm, mcnemar


def test_tests_are_of_pairs(run):
    groups = groups_of(read_run(run))
    found = {(t.setting.task, t.setting.level, t.label): t for t in success_tests(groups, lambda r: r.safe_success)}
    assert len(found) == 8
    by_place = {(g.setting.task, g.setting.level, g.label): g.records for g in groups}
    ours, theirs = by_place["pour", "L4", "screw"], by_place["pour", "L4", "rrt"]
    won = sum(a.safe_success and not b.safe_success for a, b in zip(ours, theirs, strict=True))
    lost = sum(b.safe_success and not a.safe_success for a, b in zip(ours, theirs, strict=True))
    test = found["pour", "L4", "rrt"]
    assert (test.pairs, test.only_reference, test.only_other) == (12, won, lost)
    family = [t for (_, _, label), t in found.items() if label == "rrt"]
    assert [t.adjusted for t in family] == holm([mcnemar(t.only_reference, t.only_other) for t in family])


def test_pairs_are_matched_by_scenario_and_not_by_order(tmp_path):
    folder = small_run(tmp_path / "run", levels=("L1",), methods=("screw", "replay"))
    whole = success_tests(groups_of(read_run(folder)), lambda record: record.success)
    lines = (folder / FILE).read_bytes().splitlines(keepends=True)
    (folder / FILE).write_bytes(b"".join(lines[:12] + lines[17:]))
    (test,) = success_tests(groups_of(read_run(folder)), lambda record: record.success)
    assert whole[0].pairs == 12
    assert test.pairs == 7


def test_metrics_of_successes_compare_pairs_in_which_both_succeeded(run):
    groups = groups_of(read_run(run))
    tests = {(t.setting.task, t.setting.level, t.label, t.name): t for t in metric_tests(groups)}
    by_place = {(g.setting.task, g.setting.level, g.label): g.records for g in groups}
    pairs = zip(by_place["stack", "L1", "screw"], by_place["stack", "L1", "replay"], strict=True)
    both = [(a.metrics["path_ratio"], b.metrics["path_ratio"]) for a, b in pairs if a.success and b.success]
    assert len(both) < 12
    test = tests["stack", "L1", "replay", "path_ratio"]
    assert test.difference.pairs == len(both)
    assert test.difference.mean == pytest.approx(np.mean([a - b for a, b in both]))
    assert ("stack", "L1", "replay", "clearance") not in tests
    assert tests["stack", "L4", "replay", "clearance"].difference.pairs == 12


def described(cell):
    return {"digest": cell.digest(), "label": "", "config": cell.model_dump(mode="json")}


def with_cells(folder, *changes):
    """The run with more cells like its only one, all of whose episodes fail."""
    (cell,) = read_run(folder).cells.values()
    others = [cell.model_copy(update=change) for change in changes]
    records, _ = read_records(folder / FILE)
    text = json.dumps({"version": 1, "run": "", "cells": [described(each) for each in (*others, cell)]})
    (folder / "cells.json").write_text(text)
    with (folder / FILE).open("ab") as file:
        for other in others:
            file.write(b"".join(encoded(replace(each, cell=other.digest(), success=False)) for each in records))
    return groups_of(read_run(folder))


def test_two_cells_of_one_method_are_told_apart_and_compared(tmp_path):
    folder = small_run(tmp_path / "run", 3, levels=("L1",), methods=("screw",))
    groups = with_cells(folder, {"settings": {"motion": {"guide": 0.2}, "trim": 0.1}})
    assert [group.label for group in groups] == ["screw", "screw motion.guide=0.2 trim=0.1"]
    (test,) = success_tests(groups, lambda record: record.success)
    assert (test.label, test.pairs) == (groups[1].label, 3)
    assert test.only_other == 0


def test_methods_are_compared_where_they_were_shown_as_much(tmp_path):
    folder = small_run(tmp_path / "run", 3, levels=("S",), methods=("screw",))
    few, method = {"key_poses": 4}, {"method": "decoupled"}
    groups = with_cells(folder, few, {**few, **method}, method)
    assert [(group.setting.level, group.label) for group in groups] == [
        ("S 6", "screw"), ("S 6", "decoupled"), ("S 4", "screw"), ("S 4", "decoupled"),
    ]  # fmt: skip
    tests = success_tests(groups, lambda record: record.success)
    assert [(test.setting.level, test.label, test.pairs) for test in tests] == [
        ("S 6", "decoupled", 3), ("S 4", "decoupled", 3),
    ]  # fmt: skip
    text = write_report(folder)[0].read_text(encoding="utf-8")
    assert "| stack S 4 |" in text and "levels: S 4, S 6" in text


def test_levels_are_in_the_order_of_tables():
    levels = ["T", "S 4", "L3 12 key poses", "S 12", "L1", "S 6", "F", "L3"]
    assert sorted(levels, key=rank) == ["L1", "L3 12 key poses", "L3", "F", "S 12", "S 6", "S 4", "T"]


def test_cells_that_share_a_setting_only_in_name_are_not_compared(tmp_path):
    folder = small_run(tmp_path / "run", 3, levels=("L1",), methods=("screw",))
    (cell,) = read_run(folder).cells.values()
    other = cell.model_copy(update={"env": {"n_blocks": 2}, "max_seconds": 9.0})
    suite = read_suite(folder)
    more = [frozen(other, k, {"start": {"obstacles": []}, "refused": 0}) for k in range(3)]
    Suite([*suite.scenarios, *more]).write(folder)
    records, _ = read_records(folder / FILE)
    (folder / "cells.json").write_text(
        json.dumps({"version": 1, "run": "", "cells": [described(each) for each in (cell, other)]})
    )
    with (folder / FILE).open("ab") as file:
        for record, each in zip(records, more, strict=True):
            file.write(encoded(replace(record, cell=other.digest(), scenario=each["fingerprint"])))
    groups = groups_of(read_run(folder))
    assert [(group.label, len(group.records)) for group in groups] == [
        ("screw", 3), ("screw env.n_blocks=2 max_seconds=9.0", 3),
    ]  # fmt: skip
    assert success_tests(groups, lambda record: record.success) == []
