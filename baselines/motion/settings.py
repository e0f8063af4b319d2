"""What a task's program needs to know, whoever moves the hand."""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass, field

from ...envs.core.description import TaskDescription
from ...planner.errors import BadOption
from ...planner.planning.settings import MotionSettings, PlanSettings
from ...planner.reactive.command import ReactiveSettings
from ...planner.safety.safety_layer import SafetySettings
from .motion_method import MotionMethod


@dataclass(frozen=True, slots=True)
class ProgramSettings(ABC):
    """How the demonstration becomes a program: the same for every policy, only how a leg is moved differs.

    Attributes:
        motion: the motions; see `MotionSettings`.
        safety: the layer that keeps the arm clear; see `SafetySettings`.
        resample: screw length [m] between the poses of a demonstrated segment; removes pauses and trembling
            from the rule that advances along the path.
        trim: distance [m] to the end of the transfer at which its tail is cut, because people fumble there.
        release_height: height [m] above rest at which a held object is released. Pressed on its support, a
            slightly tilted object is thrown aside when the fingers open.
        settle: seconds of standing still before the gripper moves, so that the servos catch up.
        close: seconds given to closing.
        open: seconds given to opening.
        drain: seconds of holding a glass tilted.
        guard: True: the safety layer has the last word on every command.
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

    def __post_init__(self):
        for name in ("resample", "trim"):
            if not getattr(self, name) > 0:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")
        for name in ("release_height", "settle", "close", "open", "drain"):
            if getattr(self, name) < 0:
                raise BadOption(name, f"{getattr(self, name)} is negative")

    @property
    @abstractmethod
    def motion_method(self) -> MotionMethod:
        """How a leg is moved."""

    @property
    @abstractmethod
    def plan(self) -> PlanSettings:
        """The settings as planners take them."""

    def visible_part(self, task: TaskDescription) -> TaskDescription:
        """What of a task is looked at; all of it."""
        return task

    @property
    def reactive(self) -> ReactiveSettings:
        """The settings as what follows a path takes them; a stalled motion gives up as `motion.pursuit` says."""
        return ReactiveSettings(plan=self.plan, patience=self.motion.pursuit.patience)
