"""Facts about robosuite's tasks that its environments do not tell: as data, independent of robosuite."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from ...planner.errors import BadOption, UnknownName

Bounds = tuple[float, float]
RANGES = ("D0", "D1")
"""D0: robosuite's own placement; D1: a wider one."""
REFUSED = {"Wipe": "its tool replaces the gripper, and it moves no object"}
"""robosuite's one-armed tasks that cannot be made, and why not."""
WITHOUT_SHAPED_REWARD = ("ToolHang",)
"""Tasks in which robosuite has no shaped reward."""


@dataclass(frozen=True)
class WideRange:
    """Ranges of a wider placement, relative to the middle of the table.

    Attributes:
        objects: x and y [m] by name of robosuite's sampler.
        fixture: x and y [m] by name of a fixture's body, which robosuite leaves where it is.
        apart: least horizontal distance [m] of the origins of `distant`; nearer ones are drawn anew.
        distant: names of objects and fixtures that keep this distance.
    """

    objects: dict[str, tuple[Bounds, Bounds]]
    fixture: dict[str, tuple[Bounds, Bounds]] = field(default_factory=dict)
    apart: float = 0.0
    distant: tuple[str, ...] = ()


WIDE = {
    "Stack": WideRange({"ObjectSampler": ((-0.20, 0.20), (-0.20, 0.20))}),
    "NutAssemblySquare": WideRange(
        {"SquareNutSampler": ((-0.115, 0.115), (-0.255, 0.255))},
        {"peg1": ((-0.1, 0.3), (-0.2, 0.2))},
        apart=0.14,
        distant=("SquareNut", "peg1", "peg2"),
    ),
}
"""Wider placements by task. The pegs keep their distance from each other: a nut around one must not hit the other."""


class Place(NamedTuple):
    """Place to which robosuite's success brings an object, for the obstacles on the way there.

    Attributes:
        kind: on top of another object or a fixture (a peg, onto which it is then pushed), in the object's compartment
            of a bin; or no carry, but the hand's way from its start to the object or fixture.
        thing: name of the other object or of the fixture.
    """

    kind: Literal["on", "bin", "reach"]
    thing: str = ""


SQUARE, ROUND = {"SquareNut": Place("on", "peg1")}, {"RoundNut": Place("on", "peg2")}
GROCERIES = ("Milk", "Bread", "Cereal", "Can")
PLACES: dict[str, dict[str, Place]] = {
    "Stack": {"cubeA": Place("on", "cubeB")},
    "NutAssembly": SQUARE | ROUND,
    "NutAssemblySingle": SQUARE | ROUND,
    "NutAssemblySquare": SQUARE,
    "NutAssemblyRound": ROUND,
    "PickPlace": {each: Place("bin") for each in GROCERIES},
    "PickPlaceSingle": {each: Place("bin") for each in GROCERIES},
    **{f"PickPlace{each}": {each: Place("bin")} for each in GROCERIES},
    "Door": {"Door_latch": Place("reach", "Door_latch")},
}
"""Places of the objects that a task moves; in other tasks the hand reaches for each object."""


def wide_range(task: str, name: str) -> WideRange | None:
    """Return the wider placement of a task; None for robosuite's own.

    Args:
        task: robosuite's name of the task.
        name: "D0" or "D1".

    Raises:
        UnknownName: another name.
        BadOption: the task has no wider placement.
    """
    if not isinstance(name, str) or name not in RANGES:
        raise UnknownName("range", name, RANGES)
    if name == "D1" and task not in WIDE:
        raise BadOption("range", f"{task} has no wider placement D1; those that have one: {', '.join(WIDE)}")
    return WIDE[task] if name == "D1" else None
