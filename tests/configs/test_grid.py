"""Comparisons as configs: cells, defaults, exclusions, and what is wrong with a bad one."""

from __future__ import annotations

import json
from itertools import product

import pytest
from hypothesis import given
from hypothesis import strategies as st

from onedemo.configs.dotted_keys import MISSING, at, having, leaves, merged, without
from onedemo.configs.errors import BadConfig
from onedemo.configs.grid import load_config, load_grid
from onedemo.configs.run_config import CELL_KEYS, RUN_KEYS, RunConfig, json_schema
from onedemo.configs.shipped_files import FOLDER

BASE = "name: x\ntask: stack\ndemonstration: stack\n"
TASKS = """
name: x
episodes: 3
sweep:
  task: [stack, pour]
  level: [L1, L3]
  method: [screw, rrt]
defaults:
  - when: {task: stack}
    set: {demonstration: stack, env: {n_blocks: 3}}
  - when: {task: pour}
    set: {demonstration: pour, episodes: 7}
  - when: {task: pour, method: screw}
    set: {settings: {motion: {guide: 0.2}, trim: 0.01}}
  - when: {method: [screw, other], level: L3}
    set: {settings: {motion: {guide: 0.4}}}
"""


def grid(tmp_path, text, *overrides):
    (tmp_path / "grid.yaml").write_text(text)
    return load_grid(tmp_path / "grid.yaml", list(overrides))


def test_there_is_a_cell_for_each_combination_the_first_key_slowest(tmp_path):
    cells = grid(tmp_path, TASKS).cells
    wanted = list(product(["stack", "pour"], ["L1", "L3"], ["screw", "rrt"]))
    assert [(cell.task, cell.level, cell.method) for cell in cells] == wanted
    assert len({cell.digest() for cell in cells}) == 8


def test_defaults_are_for_some_cells_later_ones_stronger_mappings_merged(tmp_path):
    cells = {(cell.task, cell.level, cell.method): cell for cell in grid(tmp_path, TASKS).cells}
    assert {cell.demonstration for key, cell in cells.items() if key[0] == "pour"} == {"pour"}
    assert cells["stack", "L1", "rrt"].env == {"n_blocks": 3}
    assert cells["pour", "L1", "rrt"].env == cells["pour", "L1", "rrt"].settings == {}
    assert cells["pour", "L1", "screw"].settings == {"motion": {"guide": 0.2}, "trim": 0.01}
    assert cells["pour", "L3", "screw"].settings == {"motion": {"guide": 0.4}, "trim": 0.01}
    assert cells["stack", "L3", "rrt"].settings == {}


def test_what_is_written_outside_is_stronger_than_defaults(tmp_path):
    """`episodes: 3` stands at the top, so that the default of 7 has no effect."""
    assert {cell.episodes for cell in grid(tmp_path, TASKS).cells} == {3}
    without_episodes = TASKS.replace("episodes: 3\n", "", 1)
    assert {(cell.task, cell.episodes) for cell in grid(tmp_path, without_episodes).cells} == {
        ("stack", 10),
        ("pour", 7),
    }
    changed = grid(tmp_path, TASKS, "settings.motion.guide=0.3", "env.n_blocks=4")
    assert {cell.settings["motion"]["guide"] for cell in changed.cells} == {0.3}
    assert {cell.env["n_blocks"] for cell in changed.cells} == {4}


def test_a_change_of_a_swept_key_takes_the_place_of_its_values(tmp_path):
    cells = grid(tmp_path, TASKS, "method=screw", "level=L9", "sweep.task=[pour]").cells
    assert [(cell.task, cell.level, cell.method) for cell in cells] == [("pour", "L9", "screw")]
    text = BASE + "sweep: {settings.motion.guide: [0.1, 0.2], settings.motion: {dt: [1, 2]}, seed: [1, 2]}\n"
    assert len(grid(tmp_path, text).cells) == 8
    assert len(grid(tmp_path, text, "settings.motion.guide=0.3").cells) == 4
    assert len(grid(tmp_path, text, "settings.motion={guide: 0.3}").cells) == 2
    assert len(grid(tmp_path, text, "sweep.settings.motion.guide=[1, 2, 3]").cells) == 12
    assert grid(tmp_path, text, "seed=1", "settings={}").cells[0].settings == {}


def test_excluded_combinations_are_left_out(tmp_path):
    text = TASKS + "exclude:\n  - {task: pour, method: rrt}\n  - {level: [L3, L4], task: stack}\n"
    found = [(cell.task, cell.level, cell.method) for cell in grid(tmp_path, text).cells]
    assert found == [
        ("stack", "L1", "screw"),
        ("stack", "L1", "rrt"),
        ("pour", "L1", "screw"),
        ("pour", "L3", "screw"),
    ]
    assert len(grid(tmp_path, text, "level=L1").cells) == 3, "a change may leave nothing to exclude"


def test_conditions_know_what_is_not_written(tmp_path):
    text = BASE + "sweep: {seed: [0, 7]}\nexclude: [{level: L1, robot: Panda, seed: 7}]\n"
    assert [cell.seed for cell in grid(tmp_path, text).cells] == [0]


def test_a_config_without_a_sweep_is_a_grid_of_one_cell(tmp_path):
    found = grid(tmp_path, BASE, "workers=3", "executor=serial")
    assert found.cells == (load_config(tmp_path / "grid.yaml"),)
    assert (found.settings.workers, found.settings.executor) == (3, "serial")
    with pytest.raises(BadConfig, match="sweep: gives 8 cells; a single one is expected"):
        (tmp_path / "grid.yaml").write_text(TASKS)
        load_config(tmp_path / "grid.yaml")


def test_the_digest_of_a_run_is_of_its_table_and_not_of_how_it_is_made(tmp_path):
    one = grid(tmp_path, TASKS).digest()
    for same in (["workers=7"], ["executor=serial"], ["wall_seconds=9.0"], ["video=false"]):
        assert grid(tmp_path, TASKS, *same).digest() == one
    for other in (["episodes=4"], ["seed=1"], ["name=y"], ["method=screw"], ["max_seconds=9.0"]):
        assert grid(tmp_path, TASKS, *other).digest() != one
    cells = {cell.digest() for cell in grid(tmp_path, TASKS).cells}
    assert {cell.digest() for cell in grid(tmp_path, TASKS, "episodes=9", "name=z").cells} == cells


def test_a_cell_is_called_by_what_tells_it_from_the_others(tmp_path):
    found = grid(tmp_path, BASE + "sweep: {level: [L1, L2], settings.trim: [0.1, 0.2], max_seconds: [1.0, null]}\n")
    labels = [found.label(cell) for cell in found.cells]
    assert labels[0] == "stack Panda L1 screw settings.trim=0.1 max_seconds=1.0"
    assert len(set(labels)) == 8


def test_cells_that_were_run_before_keep_their_digests():
    """A key that came later must not make old runs foreign."""
    ten = (
        "[screw, decoupled, replay, dmp-goal, dmp-world, potential, rrt, screw-no-repet, screw-no-guard, screw-ee-only]"
    )
    headline = load_grid(FOLDER / "bench" / "headline.yaml", [f"sweep.method={ten}"])
    assert (headline.digest(), len(headline.cells)) == ("8831db9b385a", 130)
    found = {(cell.task, cell.level, cell.method): cell.digest() for cell in headline.cells}
    assert found["stack", "L1", "screw"] == "e251194fd285"
    assert load_config(FOLDER / "bench" / "shelve_paper.yaml").digest() == "7bf59e1ce1cb"
    values = headline.cells[0].model_dump(mode="json")
    assert not {"key_poses", "tool"} & set(values)
    assert RunConfig.model_validate({**values, "key_poses": None, "tool": None}) == headline.cells[0]


def test_levels_s_and_t_say_what_is_shown_and_in_which_frame(tmp_path):
    sparse, turned = grid(tmp_path, BASE + "sweep: {level: [S, T]}\n").cells
    assert (sparse.key_poses, sparse.tool, sparse.condition) == (6, None, "S 6")
    assert (turned.key_poses, turned.tool, turned.condition) == (None, (0.1, 0.0, 0.0, 90.0), "T")
    one = grid(tmp_path, BASE + "level: S\nkey_poses: 6\n").cells[0]
    assert one.digest() == sparse.digest()
    other = grid(tmp_path, BASE + "level: T\ntool: [0, 0, 0.05, -30]\n").cells[0]
    assert other.condition == "T tool 0 0 0.05 -30" and other.digest() != turned.digest()
    assert RunConfig.model_validate(json.loads(json.dumps(other.model_dump(mode="json")))) == other
    far = grid(tmp_path, BASE + "level: L3\nkey_poses: 12\n").cells[0]
    assert far.condition == "L3 12 key poses" and far.digest() != grid(tmp_path, BASE + "level: L3\n").cells[0].digest()


def test_key_poses_are_swept_and_named(tmp_path):
    text = BASE + "sweep: {level: [L1, S], key_poses: [null, 4, 6]}\n"
    text += "exclude: [{level: L1, key_poses: [4, 6]}, {level: S, key_poses: null}]\n"
    found = grid(tmp_path, text)
    assert [found.label(cell) for cell in found.cells] == [
        "stack Panda L1 screw", "stack Panda S screw key_poses=4", "stack Panda S screw key_poses=6",
    ]  # fmt: skip


BAD = {
    "one key pose": (BASE + "key_poses: 1\n", "key_poses: .*greater than or equal to 2, got 1"),
    "a tool far away": (BASE + "tool: [2, 0, 0, 0]\n", "tool.0: .*less than or equal to 1, got 2"),
    "a tool of three": (BASE + "tool: [0, 0, 0]\n", "tool.3: is missing"),
    "a sparse level twice": (
        BASE + "level: S\nsweep: {key_poses: [null, 6]}\n",
        "sweep: gives the same cell twice: key_poses=6",
    ),
    "unknown axis": (BASE + "sweep: {levl: [L1]}\n", "sweep.levl: unknown key; did you mean 'level'\\? allowed: task"),
    "axis of a name": (BASE + "sweep: {name: [a, b]}\n", "sweep.name: unknown key; .*allowed: task"),
    "no list": (BASE + "sweep: {level: L1}\n", "sweep.level: input should be a valid list, got 'L1'"),
    "empty axis": (BASE + "sweep: {level: []}\n", "sweep.level: .*at least 1 item"),
    "a sweep of nothing": (BASE + "sweep: 3\n", "sweep: .*dictionary, got 3"),
    "nothing to be swept": (BASE + "sweep: {env: {}}\n", "sweep.env: .*list"),
    "twice the same": (BASE + "sweep: {level: [L1, L2, L1]}\n", "sweep.level: holds a value twice"),
    "swept and set": (BASE + "sweep: {task: [pour]}\n", "task: has a value, but is swept too"),
    "swept and set inside": (
        BASE + "env: {n_blocks: 3}\nsweep: {env.n_blocks: [2]}\n",
        "env.n_blocks: has a value, but is swept too",
    ),
    "two spellings": (BASE + "sweep: {env.n: [2], env: {n: [3]}}\n", "sweep.env.n: is there twice"),
    "wrong type in a cell": (
        BASE + "sweep: {level: [L1, 3]}\n",
        "level: input should be a valid string, got 3 \\(in the cell level=3\\)",
    ),
    "out of range in a cell": (BASE + "sweep: {episodes: [0]}\n", "episodes: .*greater than or equal to 1, got 0"),
    "too many": (
        BASE + f"sweep: {{seed: {list(range(200))}, episodes: {list(range(1, 200))}}}\n",
        "sweep: gives 39800",
    ),
    "the same cell": (BASE + "sweep: {episodes: [1, 2]}\n", "sweep: gives the same cell twice: episodes=2"),
    "no task": ("name: x\nsweep: {level: [L1]}\ndemonstration: x\n", "task: is missing \\(in the cell level=L1\\)"),
    "defaults no list": (BASE + "defaults: {task: 3}\n", "defaults: .*list"),
    "default of nothing": (BASE + "defaults: [{when: {task: x}}]\n", "defaults.0.set: is missing"),
    "default of a typo": (
        BASE + "defaults: [{when: {task: x}, st: {seed: 3}, set: {seed: 1}}]\n",
        "defaults.0.st: unknown key; did you mean 'set'\\? allowed: when, set",
    ),
    "default of no key": (BASE + "defaults: [{when: {tsk: x}, set: {seed: 1}}]\n", "defaults.0.when.tsk: unknown key"),
    "default for no key": (BASE + "defaults: [{when: {task: x}, set: {sed: 1}}]\n", "defaults.0.set.sed: unknown key"),
    "default without condition": (BASE + "defaults: [{when: {}, set: {seed: 1}}]\n", "defaults.0.when: .*at least 1"),
    "exclude no key": (BASE + "exclude: [{tsk: x}]\n", "exclude.0.tsk: unknown key; did you mean 'task'"),
    "exclude nothing": (BASE + "exclude: [{task: pour}]\n", "exclude.0: leaves out nothing"),
    "exclude all": (BASE + "exclude: [{task: stack}]\n", "exclude: leaves nothing to run"),
    "unknown executor": (BASE + "executor: threads\n", "executor: .*'serial', 'process' or 'ray', got 'threads'"),
    "no workers": (BASE + "workers: 0\n", "workers: .*greater than or equal to 1, got 0"),
    "half a worker": (BASE + "workers: 1.5\n", "workers: .*integer"),
    "no time": (BASE + "wall_seconds: 0\n", "wall_seconds: .*greater than 0"),
    "address of nothing": (BASE + "address: ray://x\n", "address: is only for executor: ray, which is 'process'"),
    "far key": (BASE + "colour: red\n", "colour: unknown key; allowed: name, task, .*contents, sweep, defaults"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_grid_is_refused_in_one_line_that_names_file_and_key(name, tmp_path):
    text, message = BAD[name]
    with pytest.raises(BadConfig, match=message) as caught:
        grid(tmp_path, text)
    assert str(caught.value).startswith(str(tmp_path / "grid.yaml"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    "change, message",
    [
        ("sweep.level=L1", "command line: sweep.level: input should be a valid list"),
        ("sweep.levl=[L1]", "command line: sweep.levl: unknown key"),
        ("workers=none", "command line: workers: .*integer"),
    ],
)
def test_a_bad_change_is_blamed_on_the_command_line(change, message, tmp_path):
    text = BASE + "sweep: {level: [L1, L2]}\n"
    with pytest.raises(BadConfig, match=message):
        grid(tmp_path, text, change)


@pytest.mark.parametrize("file", sorted((FOLDER / "bench").glob("*.yaml")), ids=lambda file: file.stem)
def test_shipped_configs_are_grids(file):
    found = load_grid(file)
    assert found.name == file.stem
    assert len({found.label(cell) for cell in found.cells}) == len(found.cells)


def test_the_schema_for_editors_has_every_key():
    schema = json_schema()
    assert set(schema["properties"]) == {*CELL_KEYS, *RUN_KEYS}
    assert schema["additionalProperties"] is False
    text = json.dumps(schema)
    for name in schema["$defs"]:
        assert f'"$ref": "#/$defs/{name}"' in text


keys = st.lists(st.sampled_from("abc"), min_size=1, max_size=3).map(".".join)
trees = st.recursive(
    st.integers(), lambda inner: st.dictionaries(st.sampled_from("abc"), inner, min_size=1), max_leaves=6
)
mappings = st.dictionaries(st.sampled_from("abc"), trees)


@given(mappings, keys, st.integers())
def test_what_is_put_somewhere_is_there_and_can_be_taken_away(values, key, value):
    there = having(values, key, value)
    assert at(there, key) == value
    assert at(without(there, key), key) is MISSING
    untouched = {each: found for each, found in leaves(values) if not each.startswith(key) and not key.startswith(each)}
    assert {each: at(there, each) for each in untouched} == untouched


@given(mappings, mappings)
def test_of_two_mappings_the_strong_one_wins_and_nothing_else_is_lost(weak, strong):
    both = merged(weak, strong)
    assert all(at(both, key) == value for key, value in leaves(strong))
    assert merged(both, strong) == both
    assert merged({}, weak) == merged(weak, {}) == weak
