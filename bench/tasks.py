"""What running and reporting must know of each task besides its environment."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Error:
    """The number that says how well a success went.

    Attributes:
        key: its name in `info` and in the records; the largest of several counts.
        words: what it is called.
        unit: in which it is printed.
        factor: from the recorded number to that unit.
    """

    key: str
    words: str
    unit: str
    factor: float


@dataclass(frozen=True, slots=True)
class TaskFacts:
    """A task as the program's face sees it.

    Attributes:
        id: Gymnasium's.
        error: see `Error`.
        shown: the task that its demonstration shows, where that is another one; "" for itself.
    """

    id: str
    error: Error
    shown: str = ""


TASKS = {
    "stack": TaskFacts("onedemo/Stack-v0", Error("position_error", "largest position error", "mm", 1e3)),
    "pour": TaskFacts("onedemo/Pour-v0", Error("fraction_outside", "largest share of beads outside", "%", 1e2)),
    "shelve": TaskFacts("onedemo/Shelve-v0", Error("position_error", "largest position error", "mm", 1e3)),
    "bimanual_pour": TaskFacts(
        "onedemo/BimanualPour-v0", Error("fraction_outside", "largest share of beads outside", "%", 1e2), "pour"
    ),
}
