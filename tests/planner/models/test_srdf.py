"""SRDF files give pairs of links; a pair of pieces is ignored only if all of its links are."""

from __future__ import annotations

from itertools import combinations

import pytest
from helpers.models.urdf_text import joint, link, written
from hypothesis import given
from hypothesis import strategies as st

from onedemo.planner import Arm, Body, body_from_urdf
from onedemo.planner.errors import BadModel, BadOption
from onedemo.planner.fitting.robot_parts import PartsRequest, pieces_of_links
from onedemo.planner.fitting.urdf_parts import parts_from_urdf
from onedemo.planner.models.srdf import ignored_pieces, read_srdf

SRDF = """<robot name="r"><group name="arm"/><disable_collisions link1="b" link2="a" reason="Adjacent"/>
<disable_collisions link1="b" link2="d"/></robot>"""
PIECES = {"a": "link0", "b": "link1", "c": "link2", "d": "hand", "e": "hand"}


def test_pairs_are_read_with_their_reasons(tmp_path):
    (tmp_path / "r.srdf").write_text(SRDF)
    assert read_srdf(tmp_path / "r.srdf") == {("a", "b"): "Adjacent", ("b", "d"): ""}


@pytest.mark.parametrize(
    "text, says",
    [
        (None, "SRDF: no such file"),
        ("<robot", "SRDF: cannot be read"),
        ("<urdf/>", "SRDF: is none: its root is <urdf>, not <robot>"),
        ('<robot><link name="a"/></robot>', "SRDF: is none: it has <link> elements, like a URDF"),
        ('<robot><disable_collisions link1="a"/></robot>', r"disable_collisions\[0\]: needs link1 and link2, two"),
        ('<robot><disable_collisions link1="a" link2="a"/></robot>', r"disable_collisions\[0\]: needs link1 and"),
    ],
)
def test_what_is_no_srdf_is_named(text, says, tmp_path):
    path = tmp_path / "r.srdf"
    if text is not None:
        path.write_text(text)
    with pytest.raises(BadModel, match=f"r.srdf: {says}"):
        read_srdf(path)


@given(st.sets(st.sampled_from(list(combinations("abcde", 2)))))
def test_pieces_are_ignored_only_as_a_whole(pairs):
    given_pairs = {pair: "" for pair in pairs} | {("a", "e"): ""}
    ignored = ignored_pieces(given_pairs, PIECES, "r.srdf")
    links = list(combinations(PIECES, 2))
    for first, second in combinations(sorted({*PIECES.values()}), 2):
        between = [pair for pair in links if {PIECES[pair[0]], PIECES[pair[1]]} == {first, second}]
        assert ((first, second) in ignored) == all(pair in given_pairs for pair in between)


def test_the_srdf_of_another_robot_is_refused():
    with pytest.raises(BadModel, match=r"x\.srdf: disable_collisions: names no two links of this robot's body"):
        ignored_pieces({("x", "y"): "Never"}, PIECES, "x.srdf")
    assert ignored_pieces({}, PIECES, "x.srdf") == set()


def test_links_are_known_by_their_pieces(tmp_path):
    """Links without geometry, and links beside the arm, have none."""
    ball = '<sphere radius="0.1"/>'
    parts = (link("root", ball), link("stand", ball), link("frame"), link("one", ball), link("cover", ball))
    more = (link("two", ball), link("palm", ball), link("jaw", ball), link("aside", ball))
    joints = (
        joint("w1", "root", "stand", "fixed"),
        joint("w2", "root", "frame", "fixed"),
        joint("turn", "frame", "one", xyz="0 0 1"),
        joint("w3", "one", "cover", "fixed"),
        joint("bend", "one", "two", axis="0 1 0"),
        joint("w4", "two", "palm", "fixed"),
        joint("grip", "palm", "jaw", "prismatic"),
        joint("nod", "root", "aside"),
    )
    path = written(tmp_path, *parts, *more, *joints)
    arm = Arm.from_urdf(path, tcp_frame="palm")
    assert pieces_of_links(parts_from_urdf(path, arm, None, PartsRequest({}, False)), arm.dof) == {
        "root": "link0",
        "stand": "link0",
        "one": "link1",
        "cover": "link1",
        "two": "link2",
        "palm": "hand",
        "jaw": "fingers",
    }


def test_parts_that_an_srdf_exempts_are_not_checked(tmp_path):
    box = '<box size="0.06 0.1 0.2"/>'
    joints = [joint(f"j{k}", f"l{k}", f"l{k + 1}", axis="0 1 0", xyz="0 0 0.25") for k in range(3)]
    path = written(tmp_path, *(link(f"l{k}", box) for k in range(4)), *joints)
    arm = Arm.from_urdf(path, tcp_frame="l3")
    text = '<robot><disable_collisions link1="l3" link2="l0" reason="Never"/></robot>'
    (tmp_path / "r.srdf").write_text(text)
    plain, body = body_from_urdf(path, arm), body_from_urdf(path, arm, srdf=tmp_path / "r.srdf")

    def named(body: Body) -> set[frozenset[str]]:
        return {frozenset((body.names[i], body.names[j])) for i, j in body.pairs}

    assert frozenset(("link0", "link3")) in named(plain)
    assert named(body) == named(plain) - {frozenset(("link0", "link3"))}
    with pytest.raises(BadOption, match="unknown which pairs"):
        body_from_urdf(path, arm, srdf=tmp_path / "r.srdf", exact=False)
