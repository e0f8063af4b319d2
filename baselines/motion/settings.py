"""Settings of a task's program, common to all motion methods."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from ...envs import TaskDescription
from ...planner import MotionSettings, PlanSettings, ReactiveSettings, SafetySettings
from ...planner.ranges import check_choice, check_ranges
from .motion_method import MotionMethod

GUARDED, PLAIN = "guarded", "plain"
"""Values of `ProgramSettings.hold`."""


@dataclass(frozen=True, slots=True)
class ProgramSettings(ABC):
    """Settings of the program derived from the demonstration: common to all policies; only the motion method differs.

    Attributes:
        motion: the motions; see `MotionSettings`.
        safety: the layer that keeps the arm clear; see `SafetySettings`.
        resample: path length [m] between the poses of a demonstrated segment; removes pauses and trembling
            from the rule that advances along the path.
        trim: distance [m] to the end of the transfer at which its tail is cut, because demonstrators fumble there.
        release_height: height [m] above rest at which a held object is released. Pressed on its support, a
            slightly tilted object is thrown aside when the fingers open.
        settle: seconds of standing still before the gripper moves, so that the servos catch up.
        close: seconds for closing the gripper.
        open: seconds for opening the gripper.
        drain: seconds of holding a glass tilted.
        guard: True: the safety layer filters every command.
        hold: with a real clock, what the arm does while its policy computes: "plain", it stands still; "guarded", it
            stands still as far as the safety layer allows, and retreats from what comes too close.
    """

    motion: MotionSettings = field(default_factory=MotionSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    resample: float = 0.005
    trim: float = 0.02
    release_height: float = 0.005
    settle: float = 0.5
    close: float = 0.5
    open: float = 0.3
    drain: float = 1.5
    guard: bool = True
    hold: str = PLAIN

    def __post_init__(self):
        check_ranges(self, "(0, inf]", "resample", "trim")
        check_ranges(self, "[0, inf]", "release_height", "settle", "close", "open", "drain")
        check_choice("hold", self.hold, (GUARDED, PLAIN))

    @property
    @abstractmethod
    def motion_method(self) -> MotionMethod:
        """Method of executing motions."""

    @property
    @abstractmethod
    def plan(self) -> PlanSettings:
        """Settings for planners."""

    def visible_part(self, task: TaskDescription) -> TaskDescription:
        """Return the part of a task this method may see (default: all)."""
        return task

    @property
    def reactive(self) -> ReactiveSettings:
        """Settings for followers; a stalled motion fails after the patience of `motion.pursuit`."""
        return ReactiveSettings(plan=self.plan, patience=self.motion.pursuit.patience)
