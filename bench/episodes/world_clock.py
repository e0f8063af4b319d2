"""Clock of an episode: whether the world waits while a policy computes, and how late observations are.

An environment knows no clock; this is the runner's. CPU time is measured, not elapsed time, so that other programs on
the machine do not slow a policy down.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np

from ...baselines import Policy
from ...configs import RunConfig
from ...configs.run_config import REAL, WAITS
from .scenarios import Scenario

SLOW = 0.02
"""CPU time [s] above which a call counts as slow: one control period at 50 Hz, the rate of the longer tasks."""
ROUNDING = 1e-9
"""Share of a control period by which a call may exceed it: sums of measured times are rounded."""
Observer = Callable[[Any, Any], None]
"""Called with the environment and the observation at the start and after every step."""
Result = TypeVar("Result")


@dataclass(frozen=True, slots=True)
class Pacing:
    """Passage of time in an episode.

    Attributes:
        clock: `WAITS` or `REAL`, see `RunConfig.clock`.
        delay: number of ticks by which every observation is late.
        cpu: CPU time of this process [s].
    """

    clock: str = WAITS
    delay: int = 0
    cpu: Callable[[], float] = time.process_time

    @classmethod
    def of(cls, config: RunConfig) -> Pacing:
        """Return the pacing of a cell."""
        return cls(config.clock, config.delay)


class PacedWorld:
    """An environment whose time passes as a `Pacing` says.

    Args:
        env: the environment.
        pacing: how time passes.
        observer: called at the start and after every step, held ones included, with the newest observation.

    Attributes:
        info: the environment's last `info`.
        over: True once the environment has ended the episode.
        steps: number of control steps, held ones included.
        held: number of control steps in which the policy had not answered yet.
        cpu_seconds: CPU time [s] of every call of `timed_call`.
    """

    def __init__(self, env: Any, pacing: Pacing, observer: Observer):
        self._env, self._pacing, self._observer = env, pacing, observer
        self._dt = float(env.unwrapped.control_dt)
        self._past: deque[Any] = deque(maxlen=pacing.delay + 1)
        self.info: dict[str, Any] = {}
        self.over, self.steps, self.held = False, 0, 0
        self.cpu_seconds: list[float] = []

    def begin(self, scenario: Scenario) -> None:
        """Start the episode; until there is an observation that is late enough, the first one is seen."""
        first, self.info = self._env.reset(seed=scenario.seed, options={"level": scenario.level})
        self._past.extend([first] * (self._pacing.delay + 1))
        self._observer(self._env, first)

    @property
    def seen(self) -> Any:
        """The observation that the policy gets now."""
        return self._past[0]

    def timed_call(self, compute: Callable[[], Result]) -> Result:
        """Return the result of a call of the policy, and note its CPU time."""
        before = self._pacing.cpu()
        result = compute()
        self.cpu_seconds.append(self._pacing.cpu() - before)
        return result

    def step(self, action: Any) -> None:
        """Take an action, unless the episode is over."""
        if self.over:
            return
        observation, _, terminated, truncated, self.info = self._env.step(action)
        self.over = terminated or truncated
        self.steps += 1
        self._past.append(observation)
        self._observer(self._env, observation)

    def hold(self, policy: Policy, state: Any) -> int:
        """Let the world go on for the time that the last call took beyond one control period; return the steps.

        A policy with a method `hold` chooses the action of each such step on the observation of that step. The time of
        these calls counts, too; for what they take beyond, the hold is plain.

        Args:
            policy: the policy.
            state: its state after the call.
        """
        if self._pacing.clock != REAL:
            return 0
        before, spent, guarded = self.held, self.cpu_seconds[-1], getattr(policy, "hold", None)
        late = self._late(spent)
        for _ in range(late):
            action, seconds = self._held_action(guarded, state)
            spent += seconds
            self._held_step(action)
        for _ in range(self._late(spent) - late):
            self._held_step(None)
        return self.held - before

    def _late(self, seconds: float) -> int:
        """Return the number of control periods that begin while a call takes this time, its own one excluded."""
        return max(0, math.ceil(seconds / self._dt - ROUNDING) - 1)

    def _held_action(self, guarded: Any, state: Any) -> tuple[Any, float]:
        """Return the policy's action for a held step, None for a plain hold, and the CPU time [s] of choosing it."""
        if guarded is None or self.over:
            return None, 0.0
        before = self._pacing.cpu()
        action = guarded(self.seen, state)
        return action, self._pacing.cpu() - before

    def _held_step(self, action: Any) -> None:
        if not self.over:
            self.held += 1
            # zero speed, and a gripper entry of 0 leaves the gripper as it is
            self.step(np.zeros(self._env.action_space.shape) if action is None else action)
