"""A policy that runs a task's program, its legs moved by whatever its settings say."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..envs.core.description import TaskDescription
from ..planner.errors import BadOption, PlanFailed, UnknownName
from ..planner.geometry.pose import Pose
from ..planner.imitation.demonstration import Demonstration
from ..planner.planning.settings import MotionSettings
from .motion.settings import ProgramSettings
from .motion.tool_frame import ToolFrameMotion
from .policy import EpisodePolicy, Observation, PolicyReport
from .programs.arm_executor import ArmExecutor
from .programs.bimanual_pour import BimanualPourProgram
from .programs.dual_arm_executor import DualArmExecutor
from .programs.pour import PourProgram
from .programs.reach import ReachProgram
from .programs.shelve import ShelveProgram
from .programs.stack import StackProgram
from .programs.world_model import WorldModel

Program = StackProgram | PourProgram | ShelveProgram | BimanualPourProgram | ReachProgram
PROGRAMS = {
    "stack": StackProgram,
    "pour": PourProgram,
    "shelve": ShelveProgram,
    "bimanual_pour": BimanualPourProgram,
    "reach": ReachProgram,
    "place_one": StackProgram,
    "tilt_pour": PourProgram,
    "insert_one": ShelveProgram,
}
CONTROL_MODE = "joint_velocity"


def at_rate(settings: ProgramSettings, dt: float) -> ProgramSettings:
    """The settings with the time step [s] of a task, unless they say another one.

    Raises:
        BadOption: they do.
    """
    if settings.motion.dt not in (dt, MotionSettings().dt):
        raise BadOption("motion.dt", f"{settings.motion.dt} s, but the task acts every {dt} s")
    return replace(settings, motion=replace(settings.motion, dt=dt))


class Episode:
    """What the policy remembers of an episode: the hand, the running program and how it ended."""

    def __init__(self, hand: ArmExecutor | DualArmExecutor, program: Program):
        self.executor, self.program = hand, program
        self.actions: Iterator[np.ndarray] | None = program.actions()
        self.ended = PolicyReport()


class ProgramPolicy(EpisodePolicy):
    """The program of a task, from ONE demonstration.

    Sees the observation, the demonstration and the static task description, nothing else.

    Args:
        task: what to do.
        demonstration: the one.
        settings: of the program, and of how its legs are moved.
        tool: `tcp_from_tool` of another frame of the hand, in which they are; None: in the tcp's.
    """

    def __init__(
        self, task: TaskDescription, demonstration: Demonstration, settings: ProgramSettings, tool: Pose | None = None
    ):
        if task.name not in PROGRAMS:
            raise UnknownName("task with a program", task.name, PROGRAMS)
        if task.control_mode != CONTROL_MODE:
            reason = f"{task.control_mode!r}, but the arm is moved by joint speeds: make the environment with"
            raise BadOption("control_mode", f"{reason} control_mode={CONTROL_MODE!r}")
        self.settings = settings = at_rate(settings, task.control_dt)
        self.task, self.demonstration = settings.visible_part(task), demonstration
        self.motion_method = settings.motion_method if tool is None else ToolFrameMotion(settings.motion_method, tool)

    def begin(self, observation: Observation) -> Episode:
        """A new episode; nothing is planned yet."""
        task, settings = self.task, self.settings
        if len(task.arms) == 2:
            hands = DualArmExecutor(task, settings, observation, self.motion_method)
            return Episode(hands, BimanualPourProgram(task, self.demonstration, settings, hands))
        hand = ArmExecutor(
            task.arms[0],
            task.bodies[0],
            settings.reactive,
            WorldModel(task),
            observation,
            motion_method=self.motion_method,
        )
        return Episode(hand, PROGRAMS[task.name](task, self.demonstration, settings, hand))

    def act(self, observation: Observation, memory: Episode) -> np.ndarray:
        """The next action of the program; standing still once it has ended or given up."""
        memory.executor.observation = observation
        if memory.actions is not None:
            try:
                return next(memory.actions)
            except StopIteration:
                memory.ended = PolicyReport(done=True)
            except PlanFailed as failure:
                memory.ended = PolicyReport(True, failure.reason, failure.detail)
            memory.actions = None
        return memory.executor.still()

    def report(self, state: tuple[Episode, ...], index: int = 0) -> PolicyReport:
        """What happened in the episode of one environment of the state."""
        episode = state[index]
        return replace(episode.ended, paths=(*episode.program.paths, *episode.executor.drawn))
