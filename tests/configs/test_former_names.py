"""Former names of methods and settings: read everywhere, mapped to the present ones."""

from __future__ import annotations

from dataclasses import asdict, replace

import pytest
from helpers.example_records import RECORD

from onedemo.baselines.factory import POLICIES, settings_of
from onedemo.bench.episodes.episode_records import decoded, encoded, known_record, result_of
from onedemo.bench.method_table import LOOKS
from onedemo.configs import BadConfig, RunConfig
from onedemo.configs.dataclass_settings import settings_from
from onedemo.configs.grid import grid_of
from onedemo.configs.run_config import RENAMED_METHODS
from onedemo.planner import PlanSettings

FORMER, PRESENT = "screw-no-repet", "screw-guard-only"
CELL = {"name": "x", "task": "stack", "demonstration": "stack"}


def test_every_former_name_stands_for_a_method_with_a_look():
    for former, present in RENAMED_METHODS.items():
        assert former not in POLICIES and former not in LOOKS
        assert present in POLICIES and present in LOOKS


def test_a_config_may_say_the_former_name_wherever_a_method_is_named():
    written = {
        **CELL,
        "sweep": {"method": ["screw", FORMER], "level": ["L1", "L3"]},
        "defaults": [{"when": {"method": FORMER}, "set": {"settings": {"method": FORMER}, "episodes": 3}}],
        "exclude": [{"method": [FORMER], "level": "L1"}],
    }
    cells = grid_of(written, "mine.yaml").cells
    assert [(cell.method, cell.level) for cell in cells] == [("screw", "L1"), ("screw", "L3"), (PRESENT, "L3")]
    assert cells[-1].episodes == 3
    assert cells[-1].settings == {"method": FORMER}  # a key of the policy's own
    assert grid_of(dict(CELL), "mine.yaml", [f"method={FORMER}"]).cells[0].method == PRESENT
    with pytest.raises(BadConfig, match="holds a value twice"):
        grid_of({**CELL, "sweep": {"method": [FORMER, PRESENT]}}, "mine.yaml")


def test_a_renamed_method_keeps_its_digest_so_that_its_runs_continue():
    former, present = (RunConfig(**CELL, method=name) for name in (FORMER, PRESENT))
    assert former == present
    assert present.digest() == "42df2b02158c"


def test_records_of_a_renamed_method_are_read_by_its_present_name_with_the_same_hash():
    old = {**asdict(RECORD), "method": FORMER}
    record = known_record(old)
    assert record.method == PRESENT
    assert decoded(encoded(record)) == record
    assert result_of(record)["method"] == FORMER
    assert result_of(replace(record, method="screw")) == result_of(known_record({**old, "method": "screw"}))


def test_the_former_name_has_the_settings_of_the_present_one():
    assert settings_of(FORMER) == settings_of(PRESENT)
    assert settings_of(FORMER, {"avoid": True}) == settings_of("screw")


@pytest.mark.parametrize("value, trees, search", [(True, True, True), (False, False, False)])
def test_the_former_switch_of_all_detours_sets_trees_and_search(value, trees, search):
    plan = settings_from(PlanSettings, {"avoid": value}, "scene.yaml")
    assert (plan.trees, plan.search is not None, plan.avoids) == (trees, search, value)
    assert (settings_of("screw", {"avoid": value}).trees, settings_of("tsia", {"avoid": value}).search) == (
        trees,
        search,
    )


@pytest.mark.parametrize(
    "values, message",
    [
        ({"avoid": False, "trees": True}, "scene.yaml: avoid: is the former name of trees: write one of them"),
        ({"avoid": False, "search": None}, "scene.yaml: avoid: is the former name of search: write one of them"),
        ({"avoid": "no"}, "scene.yaml: avoid: is neither true nor false, got 'no'; now it is search and trees"),
    ],
)
def test_a_former_switch_beside_the_present_ones_is_refused_in_one_line(values, message):
    with pytest.raises(BadConfig) as caught:
        settings_from(PlanSettings, values, "scene.yaml")
    assert str(caught.value) == message


def test_each_part_of_the_method_can_be_left_out_alone():
    plans = {name: settings_of(name).plan for name in ("screw", "screw-trees-only", "screw-search-only", PRESENT)}
    parts = {name: (plan.trees, plan.search is not None, plan.guard) for name, plan in plans.items()}
    assert parts == {
        "screw": (True, True, True),
        "screw-trees-only": (True, False, True),
        "screw-search-only": (False, True, True),
        PRESENT: (False, False, True),
    }
