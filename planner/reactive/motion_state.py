"""State of one motion that is being followed: its mode, its path, and how far it has come.

| mode | the arm | entered | left |
|---|---|---|---|
| PURSUING | follows the motion's path | by `go`; by a plan without a detour | to any other mode |
| DETOURING | follows a detour of it | by a plan with a detour, also past moving obstacles | to any other mode |
| TRACKING | follows joints found by a search | by a plan through joint space | to any other mode |
| DONE | stands at the end | at the end of the path or of the joints | by `go` or `stop` |
| FAILED | stands where it is | without progress for too long | by `go` or `stop` |

Waiting for a moving obstacle to pass is part of PURSUING and DETOURING: see `waiting`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from enum import Enum, auto
from typing import Any

import numpy as np

from ..control.pursuit import PursuitSettings, fresh_pursuit_state
from ..geometry.pose import PosePath
from ..imitation.constraint import Constraint, Keeping
from ..planning.attempts import NOTHING_KEPT
from ..planning.plan import NextMotion
from ..planning.planning_scene import Tightest
from ..resumable import Paced
from .command import BLOCKING
from .decision import Decision

DECIDE = 0.2
"""Seconds for which a decision to go on, to wait or to go round holds."""
HELD_BACK = 0.1
"""Share of the wanted speed below which an arm near a moving obstacle counts as waiting."""


class Mode(Enum):
    """Mode of a motion; see the module."""

    PURSUING = auto()
    DETOURING = auto()
    TRACKING = auto()
    DONE = auto()
    FAILED = auto()


@dataclass(slots=True, eq=False)
class MotionState:
    """One motion, from `go` to `stop`.

    Attributes:
        nominal: the path that was asked for.
        detours: False: along the path or not at all.
        next_motion: the motion that follows, if it is known.
        must_keep: new plans must keep some of the path, see `PlanRequest.must_keep`.
        constraint: what the nominal path keeps; None: what is found in it if the hand holds something.
        keeping: how it is kept, see `PlanRequest.keeping`.
        plan_now: the next tick plans round the standing obstacles.
        mode: see the module.
        path: the path that is followed: (a part of) the nominal one, or a detour.
        pursuit: (4,) state of the pursuit along `path`; see `planner.control.pursuit`.
        joints: (t, dof) that are tracked; None: none.
        tracked: index of the next row of `joints`.
        reached: index of the nominal pose from which on the rest was last planned.
        tries: number of stalls so far.
        stalled: seconds of all stalls before the current one.
        refusal: reason and detail of the last plan; "" if it succeeded.
        reason: the kind of failure; "" if the motion has not failed.
        detail: the facts of the failure; else "".
        line: (n, 8) path from the start's pose on, which the tool must not leave; None: not needed yet.
        waiting: the arm stands until a moving obstacle has passed.
        decision_left: seconds until going on, waiting and detours are compared again.
        planned: the plan in the making, for which the arm stands; None: none.
        decided: the decision in the making, during which the arm does as decided before; None: none.
    """

    nominal: PosePath
    detours: bool = True
    next_motion: NextMotion | None = None
    must_keep: bool = False
    constraint: Constraint | None = None
    keeping: Keeping | None = None
    plan_now: bool = False
    mode: Mode = Mode.PURSUING
    path: PosePath = field(init=False)
    pursuit: np.ndarray = field(default_factory=fresh_pursuit_state)
    joints: np.ndarray | None = None
    tracked: int = 0
    reached: int = 0
    tries: int = 0
    stalled: float = 0.0
    refusal: tuple[str, str] = ("", "")
    reason: str = ""
    detail: str = ""
    line: np.ndarray | None = None
    waiting: bool = False
    decision_left: float = 0.0
    planned: Paced[None] | None = None
    decided: Paced[Decision] | None = None

    def __post_init__(self):
        self.path = self.nominal

    @property
    def over(self) -> bool:
        """True if the motion is done or has failed."""
        return self.mode in (Mode.DONE, Mode.FAILED)

    def kept_from(self, index: int) -> dict[str, Any]:
        """Return what plans of the nominal path must keep from a pose on, as arguments of `MotionPlanner.plan`."""
        kept = None if self.constraint is None else self.constraint.part(index, self.constraint.count)
        return {"must_keep": self.must_keep, "constraint": kept, "keeping": self.keeping}

    def pursue(self, path: PosePath, *, detour: bool) -> None:
        """Follow a path from its beginning.

        Args:
            path: of the tcp.
            detour: it is a detour, not a part of the nominal path.
        """
        self.mode = Mode.DETOURING if detour else Mode.PURSUING
        self.joints = None
        self._begin(path)

    def track(self, joints: np.ndarray, path: PosePath) -> None:
        """Follow joints from their beginning.

        Args:
            joints: (t, dof) at every tick.
            path: the path that they lead to.
        """
        self.mode, self.joints, self.tracked = Mode.TRACKING, joints, 0
        self._begin(path)

    def _begin(self, path: PosePath) -> None:
        self.path, self.pursuit = path, fresh_pursuit_state()
        self.waiting, self.decision_left, self.decided = False, 0.0, None

    def fail(self, reason: str, detail: str) -> None:
        """End the motion without success.

        Args:
            reason: the kind of failure.
            detail: its facts.
        """
        self.mode, self.reason, self.detail = Mode.FAILED, reason, detail


def pursuit_of(settings: PursuitSettings, *, exact: bool) -> PursuitSettings:
    """Return the settings of the pursuit in a motion, which waits as long as it takes: patience is the motion's.

    Args:
        settings: of the motion's plans.
        exact: False: done as soon as the tool is within reach of the end.
    """
    if not exact:
        radius = settings.capture_radius
        settings = replace(settings, position_tolerance=radius, angle_tolerance=5.0 * radius)
    return replace(settings, patience=1e9)


def why_stalled(motion: MotionState, tight: Tightest | None, distance: float) -> tuple[str, str]:
    """Return reason and detail of a motion without progress.

    Args:
        motion: the motion.
        tight: the tightest pair of parts and obstacles; None: nothing is near.
        distance: slack [m] of this pair below which it blocks the motion.
    """
    reason, detail = motion.refusal
    if reason == NOTHING_KEPT:
        return "blocked", f"{reason}: {detail}"
    if tight is not None and tight.slack < distance:
        return "blocked", str(tight) if tight.slack < 0.0 else f"no progress beside it: {tight}"
    return ("blocked" if reason in BLOCKING else "ik_or_limit"), detail
