"""SRDF files: which links of a robot need not be checked against each other."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import combinations, product
from pathlib import Path

from ..errors import BadModel
from .xml_tree import parsed_xml

LinkPair = tuple[str, str]


def read_srdf(path: str | Path) -> dict[LinkPair, str]:
    """Return the pairs of links that a file disables collisions of, in the order of the alphabet, with the reasons.

    Raises:
        BadModel: no such file, no SRDF, or a pair without two links.
    """
    source = Path(path)
    if not source.is_file():
        raise BadModel(source, "SRDF", "no such file")
    robot = parsed_xml(source, "SRDF")
    if robot.find("link") is not None:
        raise BadModel(source, "SRDF", "is none: it has <link> elements, like a URDF")
    pairs = {}
    for k, element in enumerate(robot.iter("disable_collisions")):
        names = sorted((element.get("link1") or "", element.get("link2") or ""))
        if not all(names) or names[0] == names[1]:
            raise BadModel(source, f"disable_collisions[{k}]", "needs link1 and link2, two links")
        pairs[names[0], names[1]] = element.get("reason") or ""
    return pairs


def ignored_pieces(pairs: Mapping[LinkPair, str], pieces: Mapping[str, str], source: str | Path) -> set[LinkPair]:
    """Return the pairs of a body's pieces of which every link need not be checked against every link of the other.

    Args:
        pairs: of links, as `read_srdf` returns them.
        pieces: name of the piece of each link that has geometry, see `pieces_of_links`.
        source: the SRDF file, for messages.

    Raises:
        BadModel: the pairs are of links that the body has not: the file is of another robot.
    """
    known = {name for pair in pairs for name in pair}
    if pairs and len(known & pieces.keys()) < 2:
        raise BadModel(source, "disable_collisions", "names no two links of this robot's body: is it another robot's?")
    members: dict[str, list[str]] = {}
    for link, piece in pieces.items():
        members.setdefault(piece, []).append(link)

    def disabled(one: str, other: str) -> bool:
        return (min(one, other), max(one, other)) in pairs

    return {
        (first, second)
        for first, second in combinations(sorted(members), 2)
        if all(disabled(one, other) for one, other in product(members[first], members[second]))
    }
