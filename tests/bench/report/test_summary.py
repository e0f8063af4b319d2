from __future__ import annotations

import json
from dataclasses import replace

import pytest
from helpers.example_records import RECORD, some

from onedemo.bench.episodes.scenarios import scenarios_of
from onedemo.bench.report.summary import summary_row, verdict, write_summary
from onedemo.bench.workers.dispatcher import HUNG, WORKER_DIED
from onedemo.configs.grid import load_config
from onedemo.configs.shipped_files import shipped_config

CONFIG = load_config(shipped_config("stack"))
FAILED = replace(
    RECORD, index=4, seed=104, success=False, failure_reason="dropped", stage="lifted block 2 of 3", detail="slipped"
)
REQUIRED = (
    "method", "task", "robot", "level", "episodes", "successes", "safe_successes", "wilson_low", "wilson_high",
)  # fmt: skip


def test_a_row_counts_what_happened(tmp_path):
    unsafe = replace(RECORD, index=5, safe=False, collision="link5-block1")
    row = summary_row(CONFIG, [*some(4), FAILED, unsafe])
    assert set(REQUIRED) <= set(row)
    assert (row["episodes"], row["successes"], row["safe_successes"]) == (6, 5, 4)
    assert row["failures"] == {"dropped": 1}
    assert row["error_max"] == pytest.approx(2.0)
    write_summary(tmp_path / "summary.json", [row])
    assert json.loads((tmp_path / "summary.json").read_text())["rows"][0]["successes"] == 5
    assert verdict(row)[3:] == ["  1 dropped: slipped (seed 104)"]
    assert "5 of 6 succeeded" in verdict(row)[0]


def test_episodes_that_were_lost_count_as_failures_of_their_own_and_have_no_time():
    lost = replace(FAILED, seconds=0.0, tick_us=[0.0] * 4, metrics={})
    records = [*some(3), replace(lost, failure_reason=WORKER_DIED), replace(lost, failure_reason=HUNG)]
    row = summary_row(CONFIG, [*records, replace(FAILED, failure_reason=HUNG)])
    assert row["failures"] == {"worker_died": 1, "hung": 1, "timeout": 1}
    assert (row["episodes"], row["successes"]) == (6, 3)
    assert row["tick_us_median"] == RECORD.tick_us[0]
    assert row["seconds_median"] == RECORD.seconds


def test_a_run_without_any_success_says_so_in_words_and_null(tmp_path):
    row = summary_row(CONFIG, [FAILED])
    text = " ".join(verdict(row))
    assert "0 of 1 succeeded" in text
    assert "no success, so no error" in text
    assert "nan" not in text.lower()
    write_summary(tmp_path / "summary.json", [row])
    written = json.loads((tmp_path / "summary.json").read_text(), parse_constant=pytest.fail)["rows"][0]
    assert written["error_median"] is written["error_max"] is None
    assert written["seconds_median"] == FAILED.seconds


def test_the_words_of_a_run_of_nothing_are_no_numbers():
    assert "nan" not in " ".join(verdict(summary_row(CONFIG, [])))


def test_scenarios_depend_on_seed_and_count_only():
    longer = CONFIG.model_copy(update={"episodes": 20, "seed": 5, "method": "other"})
    assert [scenario.seed for scenario in scenarios_of(longer)] == list(range(5, 25))
    assert scenarios_of(CONFIG) == [s for s in scenarios_of(CONFIG.model_copy(update={"episodes": 20}))][:10]
