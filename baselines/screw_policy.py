"""The planner as a policy: one demonstration, the observation, no training."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from ..envs.task import TaskDescription
from ..planner.command import ReactiveSettings
from ..planner.demo import Demonstration
from ..planner.errors import BadOption, PlanFailed, UnknownName
from ..planner.motions import MotionSettings
from ..planner.plans import PlanSettings
from ..planner.repet import RepetSettings
from ..planner.safety import SafetySettings
from .bimanual_program import BimanualPourProgram
from .hand import Hand
from .policy import EpisodePolicy, Observation, PolicyReport
from .pour_program import PourProgram
from .shelve_program import ShelveProgram
from .stack_program import StackProgram
from .surroundings import Surroundings
from .two_hands import TwoHands


@dataclass(frozen=True, slots=True)
class ScrewSettings:
    """How the demonstration becomes a program.

    Attributes:
        motion: the motions; see `MotionSettings`.
        repet: detours round obstacles; see `RepetSettings`.
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
    """

    motion: MotionSettings = field(default_factory=MotionSettings)
    repet: RepetSettings = field(default_factory=RepetSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    resample: float = 0.005
    trim: float = 0.02
    release_height: float = 0.005
    settle: float = 0.5
    close: float = 0.5
    open: float = 0.3
    drain: float = 1.5

    def __post_init__(self):
        for name in ("resample", "trim"):
            if not getattr(self, name) > 0:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number")
        for name in ("release_height", "settle", "close", "open", "drain"):
            if getattr(self, name) < 0:
                raise BadOption(name, f"{getattr(self, name)} is negative")

    @property
    def reactive(self) -> ReactiveSettings:
        """The settings as the reactive planner takes them; a stalled motion gives up as `motion.pursuit` says."""
        plan = PlanSettings(motion=self.motion, repet=self.repet, safety=self.safety)
        return ReactiveSettings(plan=plan, patience=self.motion.pursuit.patience)


Program = StackProgram | PourProgram | ShelveProgram | BimanualPourProgram
PROGRAMS = {
    "stack": StackProgram,
    "pour": PourProgram,
    "shelve": ShelveProgram,
    "bimanual_pour": BimanualPourProgram,
}


class Episode:
    """What the policy remembers of an episode: the hand, the running program and how it ended."""

    def __init__(self, hand: Hand | TwoHands, program: Program):
        self.hand, self.program = hand, program
        self.actions: Iterator[np.ndarray] | None = program.actions()
        self.ended = PolicyReport()


class ScrewPolicy(EpisodePolicy):
    """TSIA with screw interpolation and the dual-quaternion controller, from ONE demonstration.

    Sees the observation, the demonstration and the static task description, nothing else.
    """

    def __init__(self, task: TaskDescription, demonstration: Demonstration, settings: ScrewSettings | None = None):
        if task.name not in PROGRAMS:
            raise UnknownName("task of the screw policy", task.name, PROGRAMS)
        self.task, self.demonstration = task, demonstration
        self.settings = settings or ScrewSettings()
        if abs(self.settings.motion.dt - task.control_dt) > 1e-9:
            raise BadOption("motion.dt", f"{self.settings.motion.dt} s, but the task acts every {task.control_dt} s")

    def begin(self, observation: Observation) -> Episode:
        """A new episode; nothing is planned yet."""
        task, settings = self.task, self.settings
        if len(task.arms) == 2:
            hands = TwoHands(task, settings.motion, settings.safety, observation)
            return Episode(hands, BimanualPourProgram(task, self.demonstration, settings, hands))
        hand = Hand(task.arms[0], task.bodies[0], settings.reactive, Surroundings(task), observation)
        return Episode(hand, PROGRAMS[task.name](task, self.demonstration, settings, hand))

    def act(self, observation: Observation, memory: Episode) -> np.ndarray:
        """The next action of the program; standing still once it has ended or given up."""
        memory.hand.observation = observation
        if memory.actions is not None:
            try:
                return next(memory.actions)
            except StopIteration:
                memory.ended = PolicyReport(done=True)
            except PlanFailed as failure:
                memory.ended = PolicyReport(True, failure.reason, failure.detail)
            memory.actions = None
        return memory.hand.still()

    def report(self, state: tuple[Episode, ...], index: int = 0) -> PolicyReport:
        """What happened in the episode of one environment of the state."""
        return replace(state[index].ended, paths=tuple(state[index].program.paths))
