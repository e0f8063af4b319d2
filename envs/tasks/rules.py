"""Progress in a user's own task: the compiled judge and the task's own predicates."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from ...planner.errors import OneDemoError
from ..dotted_names import said
from ..judge.dense_reward import placing
from ..judge.goal_progress import LIFTED, GoalProgress, GoalRules, contacts, goal_row
from ..judge.judge import GOAL, MEASURE, MEMORY, GoalVerdict, is_met
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, OBSTACLE, OTHER_ARM, WORLD
from ..simulation.state import State
from .success import SceneView
from .task import Task


def is_unwanted(low: int, high: int) -> bool:
    """Return whether two owners should not touch: an obstacle with anything movable, or a link with anything.

    Args:
        low: smaller owner, see `WORLD` in `scene`.
        high: larger owner.
    """
    if OBSTACLE in (low, high):
        return low != high and (low == OBSTACLE or low in (ARM, FINGERS, OTHER_ARM))
    if low == WORLD:
        return high in (ARM, OTHER_ARM)
    return low in (ARM, OTHER_ARM) and high >= OBSTACLE


def task_rules(task: Task) -> GoalRules:
    """Return the rules of a task as arrays for the judge."""
    names, count = [each.name for each in task.objects], FIRST_OBJECT + len(task.objects)
    rows = np.zeros((len(task.goals), GOAL.width))
    for row, name in zip(rows, task.goals, strict=True):
        limits, thing = task.tolerance(name), names.index(name)
        symmetry = task.objects[thing].body.yaw_symmetry
        row[:] = goal_row(thing, symmetry, across=limits.xy, along=limits.z, angle=limits.angle)
    stays = [task.success.undisturbed.get(name, (math.inf, math.inf)) for name in names]
    pairs = ((low, high) for low in range(count) for high in range(low, count) if not is_unwanted(low, high))
    return GoalRules(
        rows=rows,
        stays=np.array(stays, dtype=np.float64),
        allowed=contacts(len(names), pairs),
        withdrawn=task.success.withdrawn,
        still=task.success.still,
        ordered=task.success.in_order,
        in_turn=False,
    )


class TaskProgress(GoalProgress):
    """Progress of an episode.

    Args:
        task: the task.
        view: the scene for its predicates, set to the new state before each `update`.
        rules: see `task_rules`.
        goals: (g, 7) goals, x y z [m] and wxyz.
        start: (n, 7) poses of the objects at the start.
        dt: time between states [s].
    """

    def __init__(self, task: Task, view: SceneView, rules: GoalRules, goals: np.ndarray, start: np.ndarray, dt: float):
        super().__init__(rules, goals, start, dt)
        self._needed = max(1, round(task.success.seconds / dt))
        self.view, self._task = view, task
        self._stage, self._over = "start", False

    @property
    def failed(self) -> bool:
        """True once an object is off the table, or the task's own condition of failure holds."""
        return self._over

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return "success" if self.success else self._stage

    def update(self, state: State) -> GoalVerdict:
        """See `Progress`."""
        verdict = self._verdict(state)
        also = self._task.success.also
        done = verdict.placed == len(self.goals) and verdict.quiet == 1
        # asked at every state: it may remember what it has seen
        agreed = also is None or self._holds("also", also)
        self._settle(done and agreed, verdict)
        self._note_stage(state)
        for reason, broken in (("off_table", verdict.fallen), ("constraint", verdict.disturbed)):
            if broken:
                self._fail(reason)
        for reason, predicate in self._task.success.failed:
            if self._holds(reason, predicate):
                self._fail(reason)
        return verdict

    def _asked(self, key: str, function: Callable[[SceneView], Any]) -> Any:
        """Return what one of the task's own functions says; an exception names the function."""
        try:
            return function(self.view)
        except OneDemoError as error:
            raise self._task.bad(f"success: {key}", str(error)) from None
        except Exception as error:
            raise self._task.bad(f"success: {key}", said(error)) from error

    def _holds(self, key: str, predicate: Callable[[SceneView], bool]) -> bool:
        """Return whether a condition of the task's own holds; one that says neither is an error."""
        found = self._asked(key, predicate)
        if not isinstance(found, bool | np.bool_):
            raise self._task.bad(f"success: {key}", f"returns {found!r}; expected True or False: is a return missing?")
        return bool(found)

    def _fail(self, reason: str) -> None:
        self._failure, self._over = self._failure or reason, True

    def _note_stage(self, state: State) -> None:
        if self.placed > self._best:
            self._best, self._stage = self.placed, f"placed {self.placed} of {len(self.goals)}"
        held = state.touching[FINGERS, FIRST_OBJECT:] != 0.0
        for k in np.flatnonzero(held & (state.object_pose[:, 2] > self.memory[MEMORY.height] + LIFTED)):
            if not self._best:
                self._stage = f"lifted {self._task.objects[k].name}"

    def reward(self, state: State) -> float:
        """See `Progress`: the mean over the goals, see `dense_reward.placing`; without goals, that of success."""
        if not len(self.goals):
            return float(self.success)
        rewards, tcp = [], state.tcp_pose[0, :3]
        for row, errors in zip(self.rules.rows, self.errors, strict=True):
            thing, far = int(row[GOAL.thing]), float(np.hypot(errors[MEASURE.across], errors[MEASURE.along]))
            reach = float(np.linalg.norm(state.object_pose[thing, :3] - tcp))
            held = bool(state.touching[FINGERS, FIRST_OBJECT + thing])
            done = bool(is_met(errors, row) and not held)
            away = min(1.0, reach / max(self.rules.withdrawn, 1e-6))
            rewards.append(float(placing(reach, far, float(errors[MEASURE.angle]), held, done, away)))
        return float(np.mean(rewards))

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        wanted = self._task.success.numbers
        numbers = {name: float(self._asked(name, function)) for name, function in wanted.items()}
        position = np.hypot(self.errors[:, MEASURE.across], self.errors[:, MEASURE.along])
        angle = self.errors[:, MEASURE.angle].copy()
        return {"placed": self.placed, "position_error": position, "angle_error": angle, **numbers}
