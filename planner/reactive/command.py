"""Settings, states and commands of a reactive planner.

| state | meaning for the tick |
|---|---|
| following | the arm follows its path |
| escaping | the arm follows a detour, or joints found by a search |
| planning | the arm stands, and keeps clear of what moves, until a plan is found |
| waiting | the arm stands, or nearly so, because a moving obstacle is in the way |
| blocked | an obstacle comes closer than the arm can retreat; the command is the best possible |
| done | the end is reached |
| failed | the motion failed; `reason` is "blocked" (`detail` names part and obstacle) or "ik_or_limit" |
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..arrays import checked_kind
from ..errors import BadOption
from ..escape.detour import GOAL_IN_COLLISION, NO_ESCAPE, NODE_LIMIT, START_IN_COLLISION
from ..planning.attempts import NOTHING_KEPT
from ..planning.joint_space_motion import DEEP_CONTACT, NO_CLEAR_POSTURE, NO_JOINT_PATH
from ..planning.plan import WHY
from ..planning.settings import PlanSettings
from ..ranges import check_ranges

FOLLOWING, ESCAPING, PLANNING, WAITING, BLOCKED, DONE, FAILED = (
    "following", "escaping", "planning", "waiting", "blocked", "done", "failed",
)  # fmt: skip
BLOCKING = (
    *(WHY[status] for status in (START_IN_COLLISION, GOAL_IN_COLLISION, NO_ESCAPE, NODE_LIMIT)),
    "start in collision", "goal in collision", NO_CLEAR_POSTURE, NO_JOINT_PATH, DEEP_CONTACT, NOTHING_KEPT,
)  # fmt: skip
"""Reasons of a failed plan that mean: an obstacle is in the way of the motion as demonstrated."""
STATES = (FOLLOWING, ESCAPING, PLANNING, WAITING, BLOCKED, DONE, FAILED)


@dataclass(frozen=True, slots=True)
class ReactiveSettings:
    """Settings by which a motion is followed among obstacles that come and go.

    Attributes:
        plan: settings of its plans; `plan.motion.dt` is the time step.
        horizon: seconds for which moving obstacles are predicted; 0: no prediction, the safety layer alone.
        patience: seconds without progress after which the motion is planned anew, moving obstacles taken as static.
        give_up: seconds without progress in total after which the motion has failed.
        lead: seconds by which the safety layer sees moving obstacles ahead of time, for an arm that lags.
        thinking: share of a tick that is spent on planning, by counted costs, see `planner.resumable`; inf: a tick
            takes as long as its plan does.
    """

    plan: PlanSettings = field(default_factory=PlanSettings)
    horizon: float = 2.0
    patience: float = 1.5
    give_up: float = 40.0
    lead: float = 0.05
    thinking: float = 0.2

    def __post_init__(self):
        checked_kind("plan", self.plan, PlanSettings)
        check_ranges(self, "[0, 60)", "horizon", "lead")
        check_ranges(self, "(0, inf)", "patience", "give_up")
        check_ranges(self, "(0, inf]", "thinking")
        if self.patience > self.give_up:
            raise BadOption("patience", f"need 0 < patience <= give_up, got {self.patience} and {self.give_up}")

    @property
    def budget(self) -> float:
        """Cost [us] of the planning that is done in a tick."""
        return 1e6 * self.thinking * self.plan.motion.dt


class Command(NamedTuple):
    """The command of one tick.

    Attributes:
        velocity: (dof,) joint speeds [rad/s or m/s].
        state: one of `STATES`.
        reason: the cause of the state "blocked" or "failed"; else "".
        slack: smallest slack [m] of the near pairs; inf if no pair is near.
        detail: the part and the obstacle in its way, for the states "blocked" and "failed"; else "".
    """

    velocity: np.ndarray
    state: str
    reason: str
    slack: float
    detail: str = ""
