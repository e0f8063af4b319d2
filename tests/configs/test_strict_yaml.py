from __future__ import annotations

import pytest

from onedemo.configs.errors import BadConfig
from onedemo.configs.grid import RunConfig, load_config
from onedemo.configs.shipped_files import shipped_config, shipped_demonstration
from onedemo.configs.strict_yaml import load_mapping, parse, with_overrides
from onedemo.planner.errors import UnknownName

GOOD = "name: mine\ntask: stack\ndemonstration: stack\n"
BOMB = "a: &a [x, x]\n" + "".join(
    f"{b}: &{b} [*{a}, *{a}, *{a}]\n" for a, b in zip("abcdefgh", "bcdefghi", strict=True)
)
BAD = {
    "unknown key": (GOOD + "episods: 3\n", "episods: unknown key; did you mean 'episodes'\\? allowed: name, task"),
    "far key": (GOOD + "colour: red\n", "colour: unknown key; allowed: name, task, method"),
    "missing name": ("task: stack\ndemonstration: stack\n", "name: is missing"),
    "missing task": ("name: x\ndemonstration: stack\n", "task: is missing"),
    "text as number": (GOOD + "episodes: many\n", "episodes: .*integer, got 'many'"),
    "float as count": (GOOD + "episodes: 1.5\n", "episodes: .*integer"),
    "quoted number": (GOOD + "episodes: '3'\n", "episodes: .*integer, got '3'"),
    "no episodes": (GOOD + "episodes: 0\n", "episodes: .*greater than or equal to 1, got 0"),
    "negative seed": (GOOD + "seed: -1\n", "seed: .*greater than or equal to 0"),
    "bool as seed": (GOOD + "seed: true\n", "seed: .*integer, got True"),
    "number as bool": (GOOD + "video: 1\n", "video: .*boolean, got 1"),
    "no is a text": (GOOD + "video: no\n", "video: .*boolean, got 'no'"),
    "a list as arguments": (GOOD + "env: [n_blocks]\n", "env: .*dictionary"),
    "list as level": (GOOD + "level: [L1]\n", "level: .*string"),
    "null as level": (GOOD + "level:\n", "level: .*string"),
    "name with slash": (GOOD.replace("mine", "../mine"), "name: .*pattern"),
    "settings not a mapping": (GOOD + "settings: 3\n", "settings: .*dictionary"),
    "infinite time": (GOOD + "max_seconds: .inf\n", "max_seconds: .*3600"),
    "nan time": (GOOD + "max_seconds: .nan\n", "max_seconds"),
    "doubled key": (GOOD + "seed: 1\nseed: 2\n", "duplicate key"),
    "anchor": (GOOD + "level: &x L1\n", "line 4: anchors and aliases are not allowed"),
    "alias": (GOOD + "level: *x\n", "line 4"),
    "alias bomb": (BOMB, "line 1: anchors and aliases are not allowed"),
    "tag": (GOOD + "level: !!python/object/apply:os.system [ls]\n", "line 4: tags are not allowed"),
    "plain tag": (GOOD + "level: !mine L1\n", "line 4: tags are not allowed"),
    "a list": ("- a\n- b\n", "does not hold `key: value` lines"),
    "a word": ("hello\n", "does not hold `key: value` lines"),
    "empty": ("", "does not hold `key: value` lines"),
    "two documents": (GOOD + "---\n" + GOOD, "expected a single document|line"),
    "tab": ("name:\n\t- x\n", "line 2"),
    "open bracket": (GOOD + "settings: {a: [1\n", "line"),
    "open quote": (GOOD + "level: 'L1\n", "line"),
    "deep": ("a: " + "[" * 3000 + "\n", "is not YAML|line"),
}


@pytest.mark.parametrize("name", BAD)
def test_a_bad_config_is_refused_in_one_line_that_names_file_and_key(name, tmp_path):
    text, message = BAD[name]
    path = tmp_path / "bad.yaml"
    path.write_text(text)
    with pytest.raises(BadConfig, match=message) as caught:
        load_config(path)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_files_that_are_not_text_or_too_large_or_missing_are_named(tmp_path):
    with pytest.raises(BadConfig, match=r"none\.yaml: no such file"):
        load_mapping(tmp_path / "none.yaml")
    (tmp_path / "binary.yaml").write_bytes(b"\xff\xfe\x00name")
    with pytest.raises(BadConfig, match="is not a text file in UTF-8"):
        load_mapping(tmp_path / "binary.yaml")
    (tmp_path / "large.yaml").write_text("#" * 300_000)
    with pytest.raises(BadConfig, match="has 300000 bytes; at most 262144 are read"):
        load_mapping(tmp_path / "large.yaml")


@pytest.mark.parametrize(
    "override, message",
    [
        ("episodes", "command line: episodes: is not of the form key=value"),
        ("=3", "command line: =3: is not of the form"),
        ("episodes=many", "command line: episodes: .*integer, got 'many'"),
        ("episods=3", "command line: episods: unknown key; did you mean 'episodes'"),
        ("level.x=3", "command line: level.x: 'level' holds a value, not a mapping"),
        ("settings={a: *b}", "command line: line 1"),
    ],
)
def test_a_bad_override_is_blamed_on_the_command_line(override, message, tmp_path):
    (tmp_path / "good.yaml").write_text(GOOD + "level: L1\n")
    with pytest.raises(BadConfig, match=message):
        load_config(tmp_path / "good.yaml", [override])


def test_numbers_and_words_mean_what_yaml_1_2_says():
    assert parse("1e-3", "x") == 0.001
    assert parse("[no, off, 8:30, 0o17, ~]", "x") == ["no", "off", "8:30", 15, None]


def test_overrides_reach_into_mappings_and_leave_the_original_alone():
    values = {"settings": {"motion": {"guide": 0.5}}}
    changed = with_overrides(values, ["settings.motion.guide=0.2", "settings.new.deep=[1, 2]", "seed=7"])
    assert changed == {"settings": {"motion": {"guide": 0.2}, "new": {"deep": [1, 2]}}, "seed": 7}
    assert values == {"settings": {"motion": {"guide": 0.5}}}


def test_the_digest_is_of_the_whole_config_and_of_nothing_else(tmp_path):
    (tmp_path / "a.yaml").write_text(GOOD)
    (tmp_path / "b.yaml").write_text("# the same\n" + GOOD + "level: L1\n")
    digests = {load_config(tmp_path / name).digest() for name in ("a.yaml", "b.yaml")}
    assert len(digests) == 1
    assert load_config(tmp_path / "a.yaml", ["seed=1"]).digest() not in digests


def test_shipped_files_are_found_by_name():
    assert isinstance(load_config(shipped_config("stack")), RunConfig)
    assert shipped_demonstration("stack").is_file()
    with pytest.raises(UnknownName, match="unknown config 'stak'; known: bimanual_pour, compare, headline"):
        shipped_config("stak")
    with pytest.raises(UnknownName, match="unknown demonstration 'x'; known: lift, nut_assembly, pour, shelve, stack"):
        shipped_demonstration("x")
