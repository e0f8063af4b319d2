"""How each method is drawn, always alike, and what it needs besides an episode."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

REFERENCE = "screw"
"""The method that all others are compared with."""


@dataclass(frozen=True, slots=True)
class Look:
    """Color and marker of a method: either alone tells it from its neighbors, for whoever does not see the colors.

    Attributes:
        color: of Okabe and Ito's or Tol's color-blind safe sets.
        marker: matplotlib's.
        line: matplotlib's line style.
    """

    color: str
    marker: str
    line: str = "-"


LOOKS = {
    "screw": Look("#0072b2", "o"),
    "screw-no-repet": Look("#0072b2", "v", "--"),
    "screw-no-guard": Look("#56b4e9", "^", "--"),
    "screw-ee-only": Look("#332288", "<", "--"),
    "tsia": Look("#88ccee", ">", "--"),
    "decoupled": Look("#cc79a7", "s"),
    "replay": Look("#e69f00", "D"),
    "dmp-goal": Look("#d55e00", "P"),
    "dmp-world": Look("#882255", "X"),
    "potential": Look("#009e73", "h"),
    "rrt": Look("#444444", "*"),
    "bc": Look("#999933", "p"),
    "sac": Look("#44aa99", "d"),
    "sac-her": Look("#44aa99", "H", "--"),
    "sac-demo": Look("#117733", "d", "--"),
    "ppo": Look("#aa4499", ">"),
    "residual": Look("#661100", "8"),
}
"""In the order of tables and legends."""
SPARE = ("#ee8866", "#ddaa33", "#bb5566", "#004488", "#777777", "#aa3377")
WITHOUT_DEMONSTRATION = ("rrt", "sac", "sac-her", "ppo")
STEPS_KEYS = ("env_steps", "training_steps", "total_steps", "steps")
"""Names under which the settings of a method that learns say how long."""
ACTOR_KEYS = ("sha256", "training_steps")
"""Settings that a run writes down of an actor; nobody has chosen them."""


def look_of(method: str) -> Look:
    """The look of a method; one that is not known has the same in every report."""
    if method in LOOKS:
        return LOOKS[method]
    number = zlib.crc32(method.encode())
    return Look(SPARE[number % len(SPARE)], "osD^vP"[number // 7 % 6], ":")


def other_look(method: str, number: int) -> Look:
    """The look of the (number + 1)-th line of a method in one figure: the first one's is the method's own."""
    if number == 0:
        return look_of(method)
    return Look(SPARE[(number - 1) % len(SPARE)], "osD^vP"[(number - 1) % 6], (":", "-.")[(number - 1) // 6 % 2])


def place_of(method: str) -> tuple[int, str]:
    """Sorting key of a method."""
    known = list(LOOKS)
    return (known.index(method) if method in known else len(known), method)
