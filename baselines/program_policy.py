"""Policy that runs a task's program; its settings determine how the motions are planned."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from ..envs import TaskDescription
from ..planner import Demonstration, MotionSettings, Pose
from ..planner.errors import BadOption, PlanFailed
from ..planner.skills.skill import SegmentedSkill
from .motion.settings import PLAIN, ProgramSettings
from .motion.tool_frame import ToolFrameMotion
from .policy import EpisodePolicy, Observation, PolicyReport
from .programs.arm_executor import ArmExecutor
from .programs.bimanual_pour import BimanualPourProgram
from .programs.dual_arm_executor import DualArmExecutor
from .programs.segment_skills import skill_of_segments
from .programs.skill_program import SkillProgram
from .programs.task_skills import skill_of
from .programs.world_model import WorldModel

Program = BimanualPourProgram | SkillProgram
CONTROL_MODE = "joint_velocity"


def at_rate(settings: ProgramSettings, dt: float) -> ProgramSettings:
    """Return the settings with the time step [s] of a task.

    Args:
        settings: settings of the program.
        dt: time step of the task [s].

    Raises:
        BadOption: the settings contain another time step.
    """
    if settings.motion.dt not in (dt, MotionSettings().dt):
        raise BadOption("motion.dt", f"{settings.motion.dt} s, but the task acts every {dt} s")
    return replace(settings, motion=replace(settings.motion, dt=dt))


class Episode:
    """Memory of an episode: the executor, the running program and its end.

    Args:
        executor: executor of one or two arms.
        program: program of the task.
    """

    def __init__(self, executor: ArmExecutor | DualArmExecutor, program: Program):
        self.executor, self.program = executor, program
        self.actions: Iterator[np.ndarray] | None = program.actions()
        self.ended = PolicyReport()


class ProgramPolicy(EpisodePolicy):
    """Policy that runs a task's program from ONE demonstration.

    It sees the observation, the demonstration and the static task description, nothing else.

    Args:
        task: the task.
        demonstration: the ONE demonstration.
        settings: settings of the program and of its motions.
        tool: `tcp_from_tool` of another frame of the hand, whose motion is planned; None: the tcp.

    Raises:
        BadDemonstration, UnknownName: the task does not say what the segments of its demonstration mean, and no skill
            is found in it; see `skill_of`.
        BadOption: another control mode or time step.
    """

    def __init__(
        self, task: TaskDescription, demonstration: Demonstration, settings: ProgramSettings, tool: Pose | None = None
    ):
        if task.control_mode != CONTROL_MODE:
            reason = f"{task.control_mode!r}, but the arm is moved by joint speeds: make the environment with"
            raise BadOption("control_mode", f"{reason} control_mode={CONTROL_MODE!r}")
        self.settings = settings = at_rate(settings, task.control_dt)
        self.task, self.demonstration = settings.visible_part(task), demonstration
        self.skill = task.skill or skill_of(demonstration, task)
        self.motion_method = settings.motion_method if tool is None else ToolFrameMotion(settings.motion_method, tool)

    def begin(self, observation: Observation) -> Episode:
        """Return the memory of a new episode; nothing is planned yet."""
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
        skill = self.skill
        if isinstance(skill, SegmentedSkill):
            skill = skill_of_segments(skill, self.demonstration, task, settings, observation)
        return Episode(hand, SkillProgram(task, skill, settings, hand))

    def act(self, observation: Observation, memory: Episode) -> np.ndarray:
        """Return the next action of the program; stand still once it has finished or failed.

        Args:
            observation: one observation.
            memory: memory of the episode.
        """
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

    def hold(self, observation: Observation, state: tuple[Episode, ...]) -> np.ndarray | None:
        """Return the action of a tick that begins while the next action is computed; None: a plain hold. See `Policy`.

        Args:
            observation: one observation, of this tick.
            state: state returned by `predict`.
        """
        if self.settings.hold == PLAIN:
            return None
        executor = state[0].executor
        executor.observation = observation
        return executor.hold_still()

    def report(self, state: tuple[Episode, ...], index: int = 0) -> PolicyReport:
        """Return the report on the episode of one environment.

        Args:
            state: state returned by `predict`.
            index: index of the environment.
        """
        episode = state[index]
        return replace(episode.ended, paths=(*episode.program.paths, *episode.executor.drawn))
