"""Checks of what belongs to a robot: bodies to arms, pairs to capsules, allowed contacts to names."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import cast

import numpy as np

from ..arrays import checked_array, checked_items
from ..errors import BadModel, BadOption, UnknownName, WrongType
from ..geometry.shapes import Obstacle
from ..robot.arm import Arm
from ..robot.body import BODY, Body


def check_bodies(arms: Sequence[Arm], bodies: Sequence[Body]) -> None:
    """Refuse bodies that do not belong to their arms.

    Args:
        arms: the arms.
        bodies: one per arm, in the same order.

    Raises:
        BadModel: another number of bodies than of arms, or a capsule that moves with a joint its arm has not.
    """
    if len(arms) != len(bodies):
        raise BadModel("robot", "bodies", f"there are {len(bodies)} for {len(arms)} arms")
    for arm, body in zip(arms, bodies, strict=True):
        frames = body.rows[:, BODY.frame]
        if len(body) and frames.max() >= arm.dof:
            reason = f"moves with joint {frames.max():g}; {arm.name} has joints 0 to {arm.dof - 1}"
            raise BadModel("body", body.names[int(frames.argmax())], reason)


def checked_pairs(pairs: Sequence[tuple[int, int]], count: int) -> list[tuple[int, int]]:
    """Return pairs of capsules as tuples of ints.

    Args:
        pairs: of capsules, counted through all bodies.
        count: number of capsules.

    Raises:
        WrongType, BadShape, NotFinite, BadOption: not pairs of different whole numbers from 0 to count - 1.
    """
    if not len(checked_items("pairs", pairs, object)):
        return []
    array = checked_array("pairs", pairs, (None, 2))
    bad = np.argwhere(~((array >= 0) & (array < count) & (array == np.round(array))))
    if len(bad):
        k, place = (int(each) for each in bad[0])
        raise BadOption("pairs", f"pair {k} names capsule {array[k, place]:g}; there are capsules 0 to {count - 1}")
    twice = np.flatnonzero(array[:, 0] == array[:, 1])
    if len(twice):
        raise BadOption("pairs", f"pair {twice[0]} names capsule {array[twice[0], 0]:g} twice")
    return [(int(one), int(other)) for one, other in array]


def checked_contacts(allowed: Iterable[Sequence[str]], what: str = "allowed") -> tuple[tuple[str, str], ...]:
    """Return allowed contacts as pairs of names (of a capsule or held object, of an obstacle).

    Args:
        allowed: the pairs.
        what: their name, for messages.

    Raises:
        WrongType: `allowed` holds something else than pairs of names.
    """
    pairs = checked_items(what, allowed, Sequence)
    for k, pair in enumerate(pairs):
        if isinstance(pair, str) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
            raise WrongType(f"{what}[{k}]", pair, "a pair of names: part of the body, obstacle")
    if all(type(pair) is tuple for pair in pairs):
        return cast(tuple[tuple[str, str], ...], pairs)
    return tuple((capsule, obstacle) for capsule, obstacle in pairs)


def contact_masks(names: Sequence[str], obstacles: Sequence[Obstacle], allowed: Sequence[tuple[str, str]]) -> list[int]:
    """Return for every obstacle the capsules that may touch it, as bits of a number.

    Args:
        names: names of the capsules, counted through all bodies.
        obstacles: the obstacles.
        allowed: pairs of names (of a capsule, of an obstacle).

    Raises:
        WrongType: `allowed` holds something else than pairs of names.
        UnknownName: no capsule or no obstacle has such a name.
    """
    pairs = frozenset(checked_contacts(allowed))
    known: Mapping[str, None] = dict.fromkeys(obstacle.name for obstacle in obstacles)
    for capsule, obstacle in pairs:
        if capsule not in names:
            raise UnknownName("part of the body", capsule, dict.fromkeys(names))
        if obstacle not in known:
            raise UnknownName("obstacle", obstacle, known)
    return [sum(1 << k for k, name in enumerate(names) if (name, obstacle.name) in pairs) for obstacle in obstacles]
