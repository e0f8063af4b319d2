"""What is said of a wrong command line, of counts, of failures and of the time left."""

from __future__ import annotations

import re
import sys
from dataclasses import replace

import pytest
from helpers.example_records import RECORD
from helpers.import_graph import ROOT

from onedemo.bench import cli
from onedemo.bench.console import counted
from onedemo.bench.report.summary import DETAILS, SEEDS, summary_row, verdict
from onedemo.bench.reproduce.command import time_left
from onedemo.configs import BadConfig, RunConfig
from onedemo.envs import LEVELS
from onedemo.envs.core.levels import level_named
from onedemo.planner.errors import UnknownName

CELL = RunConfig(name="mine", task="stack", demonstration="stack")


@pytest.mark.parametrize(
    "words, said",
    [
        (["run", "stack", "--episodes", "3"], "episodes=3"),
        (["run", "stack", "--episodes=3"], "episodes=3"),
        (["run", "--max-seconds", "9", "stack"], "max_seconds=9"),
        (["train", "reach_sac", "--steps", "50"], "steps=50"),
        (["plan", "sphere", "--seed", "4"], "seed=4"),
        (["run", "stack", "--level"], "level=..."),
    ],
)
def test_a_key_written_as_an_option_is_shown_as_it_must_be_written(words, said, monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["onedemo", *words])
    with pytest.raises(SystemExit) as ended:
        cli.main()
    error = capsys.readouterr().err
    assert ended.value.code == 2 and f"keys of a config are written without dashes: {said}; usage:" in error


def test_commands_without_keys_show_none(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["onedemo", "perf", "--episodes", "3"])
    with pytest.raises(SystemExit):
        cli.main()
    assert "without dashes" not in capsys.readouterr().err


@pytest.mark.parametrize("count, words", [(0, "0 paths"), (1, "1 path"), (2, "2 paths"), (1000, "1000 paths")])
def test_one_of_a_thing_is_singular(count, words):
    assert counted(count, "path") == words


def test_failures_are_counted_by_reason_and_say_why_with_their_seeds():
    failed = replace(RECORD, success=False, safe=False, failure_reason="blocked", detail="hand is 3.2 mm from block0")
    others = [replace(failed, seed=50 + k, detail=f"reason {k}") for k in range(DETAILS + 1)]
    records = [RECORD, *(replace(failed, seed=k) for k in range(SEEDS + 1)), *others]
    records.append(replace(failed, seed=99, failure_reason="dropped", detail=""))
    lines = verdict(summary_row(CELL, records))
    blocked, dropped = (line for line in lines if line.startswith("  "))
    seeds = ", ".join(map(str, range(SEEDS)))
    assert blocked.startswith(f"  {len(records) - 2} blocked: hand is 3.2 mm from block0 (seed {seeds}, …); reason 0 (")
    assert blocked.endswith("; and 2 more reasons, see the report")
    assert dropped == "  1 dropped: no detail (seed 99)"
    assert not [line for line in verdict(summary_row(CELL, [RECORD])) if line.startswith("  ")]


@pytest.mark.parametrize(
    "seconds, done, left, words",
    [(60.0, 0, 10, ""), (60.0, 10, 0, ""), (60.0, 10, 30, ", about 3 min left"), (1.0, 10, 1, ", about 1 min left")],
)
def test_the_time_left_follows_from_what_is_done(seconds, done, left, words):
    assert time_left(seconds, done, left) == words


def test_levels_are_explained_where_one_is_unknown_and_in_the_glossary():
    with pytest.raises(UnknownName) as caught:
        level_named("L9")
    text = (ROOT / "docs/glossary.md").read_text(encoding="utf-8")
    for name, level in LEVELS.items():
        assert f"{name} ({level.words})" in str(caught.value)
        assert re.search(rf"^\| {name} \|", text, re.MULTILINE), name
    from onedemo.bench.run.config_checks import check_name, known_names

    with pytest.raises(BadConfig, match="unknown level 'L9'; known: L0: the demonstration's own layout; L1: "):
        check_name("file", "level", "L9", known_names())


@pytest.mark.parametrize(
    "word", ["escape tree", "tangent plane", "guiding pose", "shell", "tick", "guard", "slack", "margin", "cell"]
)
def test_the_glossary_defines_the_words_of_messages_and_settings(word):
    rows = re.findall(r"^\| ([^|]+) \| ([^|]{20,}) \|$", (ROOT / "docs/glossary.md").read_text(encoding="utf-8"), re.M)
    assert [meaning for words, meaning in rows if word in words.split(", ")]
    assert "docs/glossary.md" in (ROOT / "README.md").read_text(encoding="utf-8")
