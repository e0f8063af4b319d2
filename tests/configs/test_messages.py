"""What a config may be told on the command line, and what is said where it cannot be used."""

from __future__ import annotations

import re

import pytest

from onedemo.configs import BadConfig, load_grid, shipped_config
from onedemo.configs.dataclass_settings import settings_from
from onedemo.configs.errors import unknown_key
from onedemo.planner import PlanSettings
from onedemo.planner.errors import UnknownName

STACK = shipped_config("stack")
ON, OFF = ("1", "true", "True", "yes", "YES", "on", "On"), ("0", "false", "FALSE", "no", "No", "off", "OFF")


@pytest.mark.parametrize("key", ["video", "trajectories"])
@pytest.mark.parametrize("word, meant", [*((word, True) for word in ON), *((word, False) for word in OFF)])
def test_words_and_numbers_for_on_and_off_are_taken(key, word, meant):
    (cell,) = load_grid(STACK, [f"{key}={word}"]).cells
    assert getattr(cell, key) is meant


@pytest.mark.parametrize("word", ["2", "maybe", "-1", "1.0", "''", "[]", "null"])
def test_other_words_for_on_and_off_are_refused(word):
    with pytest.raises(BadConfig, match="command line: video: "):
        load_grid(STACK, [f"video={word}"])


@pytest.mark.parametrize(
    "values, key, reason",
    [
        ({"motion": {"guide": 2.0}}, "motion.guide", "2.0 is not from 0 to 1"),
        ({"motion": {"guide": 0.9}}, "motion.guide", "need 0 <= guide <= max_guide <= 1, got 0.9 and 0.75"),
        ({"tight": 0.0}, "tight", "0.0 is not in (0, 1]"),
        ({"repet": {"shell": 0.001}}, "repet.shell", "0.001 is not above the distance to keep, 0.02"),
        ({"motion": {"pursuit": {"capture_radius": -1}}}, "motion.pursuit.capture_radius", "-1.0 is not a positive"),
        ({"motion": {"guide": "far"}}, "motion.guide", "input should be a valid number"),
        ({"motion": {"giude": 0.2}}, "motion.giude", "unknown key; did you mean 'guide'? allowed: guide, max_guide"),
        ({"guide": 0.2}, "guide", "unknown key; did you mean 'motion.guide'? allowed: motion, repet"),
        ({"search": {"sedes": 2}}, "search.sedes", "unknown key; did you mean 'seeds'? allowed: step"),
        ({"xyzzy": 0.2}, "xyzzy", "unknown key; allowed: motion, repet"),
    ],
)
def test_nested_settings_name_the_field_and_what_it_takes(values, key, reason):
    with pytest.raises(BadConfig) as caught:
        settings_from(PlanSettings, values, "file")
    assert (caught.value.key, caught.value.reason[: len(reason)]) == (key, reason)
    assert "alue error" not in str(caught.value) and "\n" not in str(caught.value)


def test_a_key_without_any_allowed_one_is_refused():
    assert unknown_key("x", ()) == "unknown key; allowed: none"
    assert str(UnknownName("file", "x", ())) == "unknown file 'x'; known: none"


@pytest.mark.parametrize("task, wanted", [("stack", "stack"), ("pour", "pour"), ("place_one", "[a-z_]+")])
def test_a_comparison_without_a_demonstration_is_told_which_to_write(tmp_path, task, wanted):
    file = tmp_path / "mine.yaml"
    file.write_text(f"name: mine\ntask: {task}\nsweep: {{method: [screw, 'mine:Above']}}\n", encoding="utf-8")
    with pytest.raises(BadConfig) as caught:
        load_grid(file)
    written = re.search(rf"demonstration: is missing .*; write (demonstration: {wanted}), or a file", str(caught.value))
    assert written, str(caught.value)
    file.write_text(f"{file.read_text()}{written[1]}\n")
    assert [cell.method for cell in load_grid(file).cells] == ["screw", "mine:Above"]


def test_a_key_with_one_value_may_be_swept_on_the_command_line():
    grid = load_grid(STACK, ["sweep.method=[screw, replay]", "episodes=2"])
    assert [cell.method for cell in grid.cells] == ["screw", "replay"]
    with pytest.raises(BadConfig, match=r"method: .*; to run each of several, write 'sweep\.method=\[\.\.\.\]'"):
        load_grid(STACK, ["method=[screw, replay]"])
