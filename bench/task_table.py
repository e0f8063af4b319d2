"""What running and reporting must know of each task besides its environment."""

from __future__ import annotations

from dataclasses import dataclass

from ..envs.pour.geometry import TARGET


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
        task_metrics: metrics that no method can have been made for, each with its key in `info`; see `metric_table`.
        compared_segment: the segment of its demonstration whose motion matters; "" where there is none to compare with.
        poured_into: index of the glass that is poured into; None: nothing is poured.
        upright: what is carried should be kept level.
        demonstrated_task: the task that its demonstration shows, where that is another one; "" for itself.
    """

    id: str
    error: Error
    task_metrics: dict[str, str]
    compared_segment: str = ""
    poured_into: int | None = None
    upright: bool = True
    demonstrated_task: str = ""


OUTSIDE = Error("fraction_outside", "largest share of beads outside", "%", 1e2)
OFFSET = Error("position_error", "largest position error", "mm", 1e3)
BEADS = {"beads_lost": "beads_lost", "share_outside": "fraction_outside"}
TASKS = {
    "stack": TaskFacts(
        "onedemo/Stack-v0", OFFSET, {"stack_offset": "position_error", "stack_yaw": "yaw_error"}, "transfer"
    ),
    "pour": TaskFacts("onedemo/Pour-v0", OUTSIDE, BEADS, "carry", TARGET),
    "shelve": TaskFacts(
        "onedemo/Shelve-v0",
        OFFSET,
        {"insertion_offset": "position_error", "insertion_angle": "angle_error"},
        "insert",
        upright=False,
    ),
    "reach": TaskFacts(
        "onedemo/Reach-v0", OFFSET, {"reach_offset": "position_error"}, upright=False, demonstrated_task="stack"
    ),
    "place_one": TaskFacts(
        "onedemo/PlaceOne-v0",
        OFFSET,
        {"stack_offset": "position_error", "stack_yaw": "yaw_error"},
        "transfer",
        demonstrated_task="stack",
    ),
    "tilt_pour": TaskFacts("onedemo/TiltPour-v0", OUTSIDE, BEADS, "carry", TARGET, demonstrated_task="pour"),
    "insert_one": TaskFacts(
        "onedemo/InsertOne-v0",
        OFFSET,
        {"insertion_offset": "position_error", "insertion_angle": "angle_error"},
        "insert",
        upright=False,
        demonstrated_task="shelve",
    ),
    "bimanual_pour": TaskFacts("onedemo/BimanualPour-v0", OUTSIDE, BEADS, poured_into=TARGET, demonstrated_task="pour"),
}
