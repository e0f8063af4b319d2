"""Logs of motions as files: every bad one is refused by its name and key."""

from __future__ import annotations

import json
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from helpers.planner.motion_logs import STEPS, good

from onedemo.planner.errors import OneDemoError
from onedemo.planner.log.motion_log import BadLog, read_log, write_log

# ---- files ----


@cache
def written() -> str:
    from tempfile import TemporaryDirectory

    with TemporaryDirectory() as folder:
        write_log(good(), f"{folder}/log.json")
        with open(f"{folder}/log.json", encoding="utf-8") as file:
            return file.read()


def edited(change) -> str:
    data = json.loads(written())
    change(data)
    return json.dumps(data)


def set_(*keys, to):
    def change(data):
        for key in keys[:-1]:
            data = data[key]
        data[keys[-1]] = to

    return change


FILES = {
    "empty": (lambda: "", "file: is not readable JSON"),
    "not a table": (lambda: "[1, 2]", "format_version"),
    "torn": (lambda: written()[:-200], "file: is not readable JSON"),
    "torn in the middle": (lambda: written()[: len(written()) // 2], "file: is not readable JSON"),
    "deep": (lambda: "[" * 100_000, "file: is not readable JSON"),
    "NaN": (lambda: edited(set_("joints", 3, 2, to=float("nan"))), "file: holds NaN"),
    "infinity": (lambda: edited(set_("time", 3, to=float("inf"))), "file: holds Infinity"),
    "beyond doubles": (lambda: written().replace('"safety": 0.01', '"safety": 1e999'), "safety: is inf"),
    "a huge whole number": (lambda: written().replace('"safety": 0.01', '"safety": 1' + "0" * 400), "safety: is inf"),
    "absurd": (lambda: edited(set_("joints", 3, 2, to=1e300)), "joints[3]: is not finite, or above"),
    "unknown version": (lambda: edited(set_("format_version", to=2)), "format_version: is 2"),
    "version true": (lambda: edited(set_("format_version", to=True)), "format_version: is True"),
    "version missing": (lambda: edited(lambda d: d.pop("format_version")), "format_version: is None"),
    "unknown key": (lambda: edited(set_("speed", to=1)), "speed: is unknown"),
    "unknown key inside": (
        lambda: edited(set_("obstacles", 1, "shape", "length", to=1)),
        "obstacles[1].shape.length: is u",
    ),
    "key missing inside": (lambda: edited(lambda d: d["body"].pop("held")), "body.held: is missing"),
    "key twice": (lambda: written().replace('"safety"', '"safety": 0, "safety"'), "safety: stands twice"),
    "unknown claim": (lambda: edited(set_("claims", "beauty", to=1.0)), "claims.beauty: is unknown"),
    "text for number": (lambda: edited(set_("safety", to="0.01")), "safety: is a str"),
    "true for number": (lambda: edited(set_("safety", to=True)), "safety: is a bool"),
    "number for text": (lambda: edited(set_("obstacles", 1, "name", to=3)), "obstacles[1].name: is a int"),
    "ragged": (lambda: edited(set_("joints", 5, to=[0.0] * 6)), "joints[5]: has 6 entries; expected 7"),
    "times too few": (lambda: edited(lambda d: d["time"].pop()), "joints: has shape"),
    "no samples": (lambda: edited(lambda d: d.update(time=[], joints=[])), "time: has no samples"),
    "pose not unit": (lambda: edited(set_("obstacles", 2, "pose", 0, to=0.9)), "obstacles[2].pose: "),
    "chain not unit": (lambda: edited(set_("arm", "chain", 2, 0, to=0.9)), "arm.chain: "),
    "goal not unit": (lambda: edited(set_("goal", 0, to=3.0)), "goal: "),
    "unknown shape": (
        lambda: edited(set_("obstacles", 2, "shape", "kind", to="cone")),
        "obstacles[2].shape.kind: is 'cone'",
    ),
    "flat sphere": (lambda: edited(set_("obstacles", 1, "shape", "radius", to=0.0)), "obstacles[1].shape: "),
    "mesh with a dent": (
        lambda: edited(set_("obstacles", 3, "shape", "vertices", 0, to=[0.0, 0.0, 0.0])),
        "obstacles[3].shape: ",
    ),
    "negative margin": (lambda: edited(set_("obstacles", 0, "margin", to=-0.1)), "obstacles[0]: "),
    "frame beyond the arm": (lambda: edited(set_("body", "rows", 3, 0, to=7)), "body.rows: "),
    "allowed nobody": (lambda: edited(set_("allowed", 0, to=["cup", "moon"])), "allowed: 'cup' with 'moon'"),
    "allowed one": (lambda: edited(set_("allowed", 0, to=["cup"])), "allowed[0]: is not a pair"),
    "limits crossed": (lambda: edited(set_("arm", "lower", 2, to=9.0)), "arm: "),
    "wrong digest": (lambda: edited(set_("sha256", to="0" * 64)), "sha256: "),
    "digest of another type": (lambda: edited(set_("sha256", to=None)), "sha256: "),
    "last digit changed": (lambda: edited(set_("joints", 3, 2, to=np.nextafter(good().joints[3, 2], 9))), "sha256: "),
    "obstacle removed": (lambda: edited(lambda d: d["obstacles"].pop(1)), "sha256: "),
    "obstacle renamed": (lambda: edited(set_("obstacles", 1, "name", to="bal")), "sha256: "),
    "claim removed": (lambda: edited(lambda d: d["claims"].pop("clearance")), "sha256: "),
    "allowed removed": (lambda: edited(lambda d: d["allowed"].pop()), "sha256: "),
    "held renamed": (lambda: edited(set_("body", "held", to=[])), "sha256: "),
}


@pytest.mark.parametrize("case", FILES)
def test_a_bad_file_is_refused_by_its_name_and_key(tmp_path, case):
    make, reason = FILES[case]
    path = tmp_path / "log.json"
    text = make()
    assert text != written()
    path.write_text(text, encoding="utf-8")
    with pytest.raises(BadLog) as caught:
        read_log(path)
    message = str(caught.value)
    assert message.startswith(f"{path}: {reason}"), message
    assert "\n" not in message
    assert isinstance(caught.value, OneDemoError) and isinstance(caught.value, ValueError)


def test_a_file_that_is_missing_too_large_or_no_text_is_refused(tmp_path, monkeypatch):
    with pytest.raises(BadLog, match="file: does not exist"):
        read_log(tmp_path / "none.json")
    (tmp_path / "binary.json").write_bytes(b"\xff\xfe\x00")
    with pytest.raises(BadLog, match="file: is not readable JSON"):
        read_log(tmp_path / "binary.json")
    monkeypatch.setattr("onedemo.planner.log.motion_log.MAX_BYTES", 1000)
    (tmp_path / "large.json").write_text(written())
    with pytest.raises(BadLog, match=r"file: holds \d+ bytes; at most 1000"):
        read_log(tmp_path / "large.json")
    with pytest.raises(BadLog, match="file: would hold"):
        write_log(good(), tmp_path / "a.json")


@pytest.mark.parametrize("key", sorted(json.loads(written())))
def test_every_key_is_needed(tmp_path, key):
    path = tmp_path / "log.json"
    path.write_text(edited(lambda data: data.pop(key)))
    with pytest.raises(BadLog) as caught:
        read_log(path)
    assert caught.value.key == key


def leaves(value, keys=()):
    items = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    if isinstance(value, float | int | str):
        yield keys
    for key, item in items:
        yield from leaves(item, (*keys, key))


def test_no_change_of_any_entry_goes_unnoticed(tmp_path):
    rng = np.random.default_rng(0)
    write_log(replace(good(), time=good().time[:3], joints=good().joints[:3]), tmp_path / "log.json")
    short = json.loads((tmp_path / "log.json").read_text())
    every = list(leaves(short))
    groups = {}
    for keys in every:
        groups.setdefault(tuple(k for k in keys if isinstance(k, str)), []).append(keys)
    path, text = tmp_path / "log.json", json.dumps(short)
    count = 0
    for group in groups.values():
        for index in rng.permutation(len(group))[:4]:
            *outer, last = group[index]
            data = whole = json.loads(text)
            for key in outer:
                data = data[key]
            old = data[last]
            data[last] = old + "x" if isinstance(old, str) else old + rng.choice([1e-9, -1e-6, 0.1, 1.0])
            path.write_text(json.dumps(whole))
            with pytest.raises(BadLog):
                read_log(path)
            count += 1
    assert count > 80


@pytest.mark.parametrize(
    "changes, key",
    [
        ({"joints": np.full((STEPS, 7), np.nan)}, "joints[0]"),
        ({"joints": np.zeros((STEPS, 6))}, "joints"),
        ({"time": ["a"] * STEPS}, "time"),
        ({"safety": float("nan")}, "safety"),
        ({"safety": -0.1}, "safety"),
        ({"claims": {"clearance": float("inf")}}, "claims.clearance"),
        ({"claims": {"beauty": 1.0}}, "claims.beauty"),
        ({"allowed": [("", "table")]}, "allowed"),
        ({"format_version": 0}, "format_version"),
    ],
)
def test_what_cannot_be_a_log_is_no_log(changes, key):
    with pytest.raises(BadLog) as caught:
        replace(good(), **changes)
    assert caught.value.key == key
