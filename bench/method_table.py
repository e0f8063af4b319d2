"""Style of each method in figures, always the same, and what the method needs besides an episode."""

from __future__ import annotations

import zlib
from dataclasses import dataclass

REFERENCE = "screw"
"""Method that all others are compared with."""


@dataclass(frozen=True, slots=True)
class Look:
    """Color and marker of a method; either alone is distinctive, for readers who do not see the colors.

    Attributes:
        color: from Okabe and Ito's or Tol's color-blind safe sets.
        marker: matplotlib marker.
        line: matplotlib line style.
    """

    color: str
    marker: str
    line: str = "-"


LOOKS = {
    "screw": Look("#0072b2", "o"),
    "screw-trees-only": Look("#6699cc", "+", "--"),
    "screw-search-only": Look("#222255", "x", "--"),
    "screw-guard-only": Look("#0072b2", "v", "--"),
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
"""Look of every known method, in the order of tables and legends."""
SPARE = ("#ee8866", "#ddaa33", "#bb5566", "#004488", "#777777", "#aa3377")
"""Colors of methods that are not in `LOOKS`."""
WITHOUT_DEMONSTRATION = ("rrt", "sac", "sac-her", "ppo")
"""Methods that use no demonstration."""
STEPS_KEYS = ("env_steps", "training_steps", "total_steps", "steps")
"""Settings keys under which learning methods state their number of training steps."""
ACTOR_KEYS = ("sha256", "training_steps")
"""Settings recorded by a run about its actor; they do not count as tuned."""


def look_of(method: str) -> Look:
    """Return the look of a method; an unknown method gets a look from a hash of its name, equal in every report."""
    if method in LOOKS:
        return LOOKS[method]
    number = zlib.crc32(method.encode())
    return Look(SPARE[number % len(SPARE)], "osD^vP"[number // 7 % 6], ":")


def other_look(method: str, number: int) -> Look:
    """Return the look of the (number + 1)-th line of one method in a figure.

    Args:
        method: name of the method.
        number: index of the line among those of the method; line 0 has the method's own look.
    """
    if number == 0:
        return look_of(method)
    return Look(SPARE[(number - 1) % len(SPARE)], "osD^vP"[(number - 1) % 6], (":", "-.")[(number - 1) // 6 % 2])


def place_of(method: str) -> tuple[int, str]:
    """Return the sorting key of a method: the order of `LOOKS`, then unknown methods by name."""
    known = list(LOOKS)
    return (known.index(method) if method in known else len(known), method)
