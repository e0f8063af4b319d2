"""A body that was fitted before is read from the cache, number by number as it was; anything else is fitted."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from helpers.models.urdf_text import joint, link, written

from onedemo.planner import Arm, Body, body_from_urdf
from onedemo.planner.errors import BadModel, ModelWarning
from onedemo.planner.fitting import kept_bodies
from onedemo.planner.fitting.link_capsules import body_of


def robot(folder, size: str = "0.05 0.05 0.2", upper: float = 2.0):
    """A file of an arm of boxes and a ball."""
    box, bar = f'<box size="{size}"/>', '<box size="0.3 0.03 0.03"/>'
    names, shapes = ("base", "one", "two", "tip"), (box, '<sphere radius="0.04"/>', bar, box)
    limit = f'<limit lower="-2" upper="{upper}" effort="1" velocity="1"/>'
    links = [link(name, shape) for name, shape in zip(names, shapes, strict=True)]
    joints = [joint(f"to_{b}", a, b, axis="0 1 0", more=limit, xyz="0 0 0.22") for a, b in pairwise(names)]
    return written(folder, *links, *joints)


@pytest.fixture
def fitted(tmp_path, monkeypatch) -> list[Body]:
    """The bodies that were fitted, not read; kept in a folder of the test's own."""
    fits: list[Body] = []

    def counted(*arguments, **options):
        found = body_of(*arguments, **options)
        fits.append(found[0])
        return found

    (tmp_path / "kept").mkdir()
    monkeypatch.setattr(kept_bodies, "cache_folder", lambda source: tmp_path / "kept")
    monkeypatch.setattr(kept_bodies, "body_of", counted)
    return fits


def covered(file, **options) -> Body:
    return body_from_urdf(file, Arm.from_urdf(file, tcp_frame="tip"), **options)


def check_equal(one: Body, other: Body) -> None:
    assert np.array_equal(one.rows, other.rows)
    assert (one.names, one.held, one.pairs) == (other.names, other.held, other.pairs)
    assert dict(one.margins) == dict(other.margins)
    for mine, its in zip(one.hulls, other.hulls, strict=True):
        assert (mine is None) == (its is None)
        if mine is not None and its is not None:
            assert np.array_equal(mine.corners, its.corners) and mine.rounding == its.rounding
    shared = [[hull is each for each in one.hulls] for hull in one.hulls]
    assert shared == [[hull is each for each in other.hulls] for hull in other.hulls]


def test_the_same_robot_is_fitted_once(tmp_path, fitted):
    first = covered(robot(tmp_path))
    (tmp_path / "elsewhere").mkdir()
    second = covered(robot(tmp_path / "elsewhere"))
    assert len(fitted) == 1 and any(hull is None for hull in first.hulls) and any(first.hulls)
    check_equal(first, second)


def test_a_body_with_margins_and_shared_hulls_is_kept_whole(tmp_path, fitted):
    body = covered(robot(tmp_path))
    hulls = (body.hulls[0], body.hulls[0], *body.hulls[2:])
    body = replace(body, hulls=hulls, pairs=((0, 2), (1, 3)), margins={(0, 2): 0.1 + 0.2, (1, 3): 0.0})
    for doubts in ((), ("one: is doubtful", "two, too")):
        kept_bodies._write(tmp_path / "one.npz", body, doubts)
        again, read = kept_bodies._read(tmp_path / "one.npz")
        check_equal(body, again)
        assert read == doubts


def test_what_is_doubtful_is_said_again_by_a_body_that_was_kept(tmp_path, fitted):
    """A beam that no joint of the arm moves, and that reaches through all of it."""
    box, beam = '<box size="0.06 0.06 0.06"/>', '<box size="1.6 0.05 1.6"/>'
    names = ("base", "one", "two", "tip")
    joints = [joint(f"to_{b}", a, b, axis="0 1 0", xyz="0 0 0.2") for a, b in pairwise(names)]
    free = (link("beam", beam), joint("free", "one", "beam", "continuous", xyz="0 0.5 0"))
    file = written(tmp_path, *(link(name, box) for name in names), *joints, *free)
    for _ in range(2):
        with pytest.warns(ModelWarning, match="sweep what hangs on it through") as said:
            covered(file)
        assert len([each for each in said if "sweep" in str(each.message)]) == 1
    assert len(fitted) == 1


def test_another_robot_is_fitted(tmp_path, fitted):
    covered(robot(tmp_path))
    covered(robot(tmp_path, size="0.05 0.05 0.2001"))
    covered(robot(tmp_path, upper=2.1))
    covered(robot(tmp_path), split=1)
    assert len(fitted) == 4


def test_without_hulls_nothing_is_kept(tmp_path, fitted):
    covered(robot(tmp_path), exact=False)
    covered(robot(tmp_path), exact=False)
    assert len(fitted) == 2 and not list((tmp_path / "kept").iterdir())


def test_what_cannot_be_covered_is_refused_each_time(tmp_path, fitted):
    file = written(tmp_path, link("base"), link("tip"), joint("to_tip", "base", "tip"))
    for _ in range(2):
        with pytest.raises(BadModel):
            covered(file)


@pytest.mark.parametrize("damage", [b"", b"PK\x03\x04 no archive", None])
def test_a_damaged_file_is_fitted_anew_and_replaced(tmp_path, fitted, damage):
    first = covered(robot(tmp_path))
    (kept,) = (tmp_path / "kept").iterdir()
    kept.write_bytes(kept.read_bytes()[:-50] if damage is None else damage)
    check_equal(first, covered(robot(tmp_path)))
    check_equal(first, covered(robot(tmp_path)))
    assert len(fitted) == 2


def test_a_file_of_impossible_numbers_is_fitted_anew(tmp_path, fitted):
    first = covered(robot(tmp_path))
    (kept,) = (tmp_path / "kept").iterdir()
    table = dict(np.load(kept))
    table["rows"] = table["rows"] * np.nan
    np.savez(kept, **table)
    check_equal(first, covered(robot(tmp_path)))


def test_where_nothing_can_be_kept_it_is_fitted(tmp_path, fitted, monkeypatch):
    monkeypatch.setattr(kept_bodies, "cache_folder", lambda source: None)
    check_equal(covered(robot(tmp_path)), covered(robot(tmp_path)))
    monkeypatch.setattr(kept_bodies, "cache_folder", lambda source: tmp_path / "gone")
    check_equal(covered(robot(tmp_path)), covered(robot(tmp_path)))
    assert len(fitted) == 4
