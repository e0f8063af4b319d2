"""Progress of tasks in which objects have goals: the rules as arrays for the compiled judge, and what it has seen."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OTHER_ARM, OTHER_FINGERS
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State
from .dense_reward import gaps, placing
from .judge import GOAL, LIMIT, MEASURE, MEMORY, GoalVerdict, judge_state, shaped
from .progress import Progress

LOWEST = TABLE_HEIGHT - 0.05
"""Height (z) of an object's frame below which it has fallen off the table [m]."""
LIFTED = 0.02
"""Height above its start from which an object counts as lifted [m]."""
STILL = 0.01
"""Speed up to which an object counts as at rest [m/s]."""
OWN_CONTACTS = ((ARM, FINGERS), (OTHER_ARM, OTHER_FINGERS))
"""Contacts of an arm with itself, which are ignored."""


def contacts(objects: int, pairs: Iterable[tuple[int, int]]) -> np.ndarray:
    """Return which owners may touch, (owners, owners) with 1 where they may; every owner may touch itself.

    Args:
        objects: number of objects.
        pairs: wanted contacts, the smaller owner first, see `WORLD` in `scene`; those of an arm with itself are added.
    """
    allowed = np.eye(FIRST_OBJECT + objects)
    for low, high in (*OWN_CONTACTS, *pairs):
        allowed[low, high] = 1.0
    return allowed


def goal_row(thing: int, symmetry: float = 2.0 * math.pi, lost: float = math.inf, **tolerances: float) -> np.ndarray:
    """Return the row (`GOAL.width`,) that describes a goal to the judge.

    Args:
        thing: index of the object.
        symmetry: smallest turn after which it looks the same [rad].
        lost: error, by the first tolerance, from which an object that was lifted and rests was dropped.
        tolerances: largest errors by name of the measure, see `MEASURE`.
    """
    row = np.full(GOAL.width, math.inf)
    row[GOAL.thing], row[GOAL.yaw_symmetry], row[GOAL.lost] = thing, symmetry, lost
    row[GOAL.lost_by] = getattr(MEASURE, next(iter(tolerances)))
    for name, most in tolerances.items():
        row[GOAL.tolerances + getattr(MEASURE, name)] = most
    return row


@dataclass(frozen=True, eq=False)
class GoalRules:
    """When objects are at their goals.

    Attributes:
        rows: (g, `GOAL.width`) the goals, see `goal_row`.
        stays: (n, 2) how far [m, rad] an object may be moved; infinite: anywhere.
        allowed: (owners, owners) wanted contacts, see `contacts`.
        withdrawn: least distance of the withdrawn tcp from objects with goals [m].
        still: largest speed of an object at rest [m/s].
        ordered: whether the goals must be met in their order.
        in_turn: whether the fingers may only touch the object whose turn it is, and the one before; then the order is
            that of the objects.
        words: name of an object, and what it is once it is at its goal, like ("block", "placed").
        numbers: measures in `info`, by name.
        disturbed: name in `info` of whether an object that must stay was moved; "": it is not told.
    """

    rows: np.ndarray
    stays: np.ndarray
    allowed: np.ndarray
    withdrawn: float
    still: float = STILL
    ordered: bool = True
    in_turn: bool = True
    words: tuple[str, str] = ("object", "placed")
    numbers: Mapping[str, int] = field(default_factory=dict)
    disturbed: str = ""

    @property
    def limits(self) -> np.ndarray:
        """(`LIMIT.width`,) limits for the judge."""
        limits = np.zeros(LIMIT.width)
        limits[LIMIT.still], limits[LIMIT.withdrawn] = self.still, self.withdrawn
        limits[LIMIT.lowest], limits[LIMIT.lifted] = LOWEST, LIFTED
        limits[LIMIT.ordered], limits[LIMIT.in_turn] = float(self.ordered), float(self.in_turn)
        return limits


class GoalProgress(Progress):
    """Progress of an episode, updated from the simulator's state at each step.

    Args:
        rules: see `GoalRules`.
        goals: (g, 7) goals, x y z [m] and wxyz.
        start: (n, 7) poses of the objects at the start; of one in the hand where it was before.
        dt: time between states [s].
        in_hand: index of an object in the hand from the start; None: there is none.
        dense: function of progress and state that returns the dense reward; None: `share_done`.
    """

    def __init__(
        self,
        rules: GoalRules,
        goals: np.ndarray,
        start: np.ndarray,
        dt: float,
        *,
        in_hand: int | None = None,
        dense: Callable[[GoalProgress, State], float] | None = None,
    ):
        super().__init__(dt)
        self.rules, self.goals, self._limits, self._dense = rules, goals, rules.limits, dense or share_done
        self.allowed, self._start = rules.allowed.copy(), start.copy()
        self.memory = np.zeros((MEMORY.width, len(start)))
        self.memory[MEMORY.height] = start[:, 2]
        if in_hand is not None:
            self.memory[MEMORY.was_lifted, in_hand] = 1.0
        self.errors = np.zeros((len(goals), MEASURE.width))
        self.placed, self.held, self.disturbed = 0, False, False
        self._best, self._failure = 0, ""

    @property
    def motion_index(self) -> float:
        """2k while k objects are in place, 2k + 1 while another one is in the hand."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """True once an object is off the table."""
        return self._failure == "off_table"

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        (thing, placed), count = self.rules.words, len(self.goals)
        if not self._best:
            return "start"
        done, lifted = divmod(self._best, 2)
        return f"lifted {thing} {done + 1} of {count}" if lifted else f"{placed} {done} of {count}"

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed at present, "" if it can."""
        return self._failure

    def put(self, k: int, pose: np.ndarray) -> None:
        """Note that object k was put at a pose (7,) by someone else.

        Args:
            k: index of the object.
            pose: its pose.
        """
        self._start[k] = pose
        self.memory[MEMORY.height, k] = pose[2]

    def _verdict(self, state: State) -> GoalVerdict:
        self.errors = np.empty((len(self.goals), MEASURE.width))
        poses, moving, rules = state.object_pose, state.object_velocity, self.rules
        known = (self.goals, self._start, rules.rows, rules.stays, self._limits, self.allowed, self.memory, self.errors)
        verdict = GoalVerdict(*judge_state(poses, moving, state.tcp_pose, state.touching, *known))
        self.placed, self.held, self.disturbed = verdict.placed, verdict.held == 1, verdict.disturbed == 1
        return verdict

    def update(self, state: State) -> GoalVerdict:
        """See `Progress`."""
        verdict = self._verdict(state)
        done = verdict.placed == len(self.goals) and verdict.quiet and not verdict.disturbed
        self._settle(bool(done), verdict)
        self._best = max(self._best, 2 * verdict.placed + verdict.raised)
        found = (("off_table", verdict.fallen), ("dropped", verdict.lost), ("constraint", verdict.disturbed))
        self._failure = next((name for name, broken in found if broken), "")
        return verdict

    def reward(self, state: State) -> float:
        """See `Progress`."""
        return self._dense(self, state)

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        rules = self.rules
        numbers = {name: self.errors[:, which].copy() for name, which in rules.numbers.items()}
        disturbed = {rules.disturbed: self.disturbed} if rules.disturbed else {}
        return {f"{rules.words[0]}s_placed": self.placed, **numbers, **disturbed}


def share_done(progress: GoalProgress, state: State) -> float:
    """Return the dense reward in [0, 1] for placing objects in order, see `judge.shaped`.

    Args:
        progress: progress in a task with an order.
        state: the state.
    """
    return shaped(state.object_pose, progress.goals, state.tcp_pose, progress.placed, progress.held)


def one_placed(progress: GoalProgress, state: State, *, k: int, half_turns: bool) -> float:
    """Return the dense reward in [0, 1] for placing one object, see `dense_reward.placing`.

    Args:
        progress: progress in a task in which this is the last object to be placed.
        state: the state.
        k: index of the object and its goal.
        half_turns: whether half turns about its z axis are ignored.
    """
    pose, goal, tcp = state.object_pose[k], progress.goals[k], state.tcp_pose[0]
    far, angle = gaps(pose, goal, half_turns=half_turns)
    reach = float(np.linalg.norm(pose[:3] - tcp[:3]))
    away, done = min(1.0, reach / progress.rules.withdrawn), progress.placed == len(progress.goals)
    return float(placing(reach, float(far), float(angle), progress.held, done, away))
