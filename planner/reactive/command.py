"""What a reactive planner is told and what it says: settings, states, commands.

| state | what it says of the tick |
|---|---|
| following | on the leg's path |
| escaping | on a detour of it, or on joints that a search has found |
| waiting | it stands, or as good as, because something that moves is in the way |
| blocked | something comes closer than the arm can keep away: this is the best there is |
| done | the end is reached |
| failed | it has given up; `reason` is "blocked" (`detail` names what is in the way of what) or "ik_or_limit" |
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import BadOption
from ..planning.settings import PlanSettings

FOLLOWING, ESCAPING, WAITING, BLOCKED, DONE, FAILED = (
    "following", "escaping", "waiting", "blocked", "done", "failed",
)  # fmt: skip
STATES = (FOLLOWING, ESCAPING, WAITING, BLOCKED, DONE, FAILED)


@dataclass(frozen=True, slots=True)
class ReactiveSettings:
    """How a leg is followed among obstacles that come and go.

    Attributes:
        plan: how it is planned; `plan.motion.dt` is the time step.
        horizon: seconds for which obstacles are foreseen with their velocity; 0: not at all, what moves is left to
            the safety layer.
        patience: seconds without progress after which it is planned anew, with what moves as if it stood still.
        give_up: seconds without progress in all after which the leg has failed.
        lead: seconds that the safety layer looks at moving obstacles ahead of time, for an arm that lags.
    """

    plan: PlanSettings = field(default_factory=PlanSettings)
    horizon: float = 2.0
    patience: float = 1.5
    give_up: float = 40.0
    lead: float = 0.05

    def __post_init__(self):
        for name in ("horizon", "lead"):
            if not 0 <= getattr(self, name) < 60:
                raise BadOption(name, f"{getattr(self, name)} is not from 0 to 60 s")
        if not 0 < self.patience <= self.give_up < math.inf:
            raise BadOption("patience", f"need 0 < patience <= give_up, got {self.patience} and {self.give_up}")


class Command(NamedTuple):
    """What to do now.

    Attributes:
        velocity: (dof,) joint speeds [rad/s or m/s].
        state: one of `STATES`.
        reason: why, where the state is "blocked" or "failed".
        slack: smallest distance of a close pair less what it must keep [m]; inf if nothing is close.
        detail: what is in the way of what, where the state is "blocked" or "failed" and something is.
    """

    velocity: np.ndarray
    state: str
    reason: str
    slack: float
    detail: str = ""
