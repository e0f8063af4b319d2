"""Progress in a user's own task: the compiled judge and the task's own predicates."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...planner.errors import OneDemoError
from ..core.dense_reward import placing
from ..core.progress import Progress
from ..dotted_names import said
from ..scene.scene import FINGERS, FIRST_OBJECT
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State
from .judge import GOAL, TaskVerdict, judge_task
from .success import SceneView
from .task import Task

LOWEST = TABLE_HEIGHT - 0.05
"""Height (z) of an object's frame below which it has fallen off the table [m]."""
LIFTED = 0.02
"""Height above its start from which a held object counts as lifted [m]."""


def goal_rows(task: Task) -> np.ndarray:
    """Return the rows (g, `GOAL.width`) that describe a task's goals to the judge."""
    names, rows = [each.name for each in task.objects], np.zeros((len(task.goals), GOAL.width))
    for row, name in zip(rows, task.goals, strict=True):
        limits, thing = task.tolerance(name), names.index(name)
        row[:] = thing, task.objects[thing].body.yaw_symmetry, limits.xy, limits.z, limits.angle
    return rows


class TaskProgress(Progress):
    """Progress of an episode.

    Args:
        task: the task.
        view: the scene for its predicates, set to the new state before each `update`.
        rows: see `goal_rows`.
        goals: (g, 7) goals, x y z [m] and wxyz.
        start: (n, 7) poses of the objects at the start.
        dt: time between states [s].
    """

    def __init__(self, task: Task, view: SceneView, rows: np.ndarray, goals: np.ndarray, start: np.ndarray, dt: float):
        super().__init__(dt)
        self._needed = max(1, round(task.success.seconds / dt))
        self.view, self._task, self._goals, self._heights = view, task, goals, start[:, 2].copy()
        self._rows, self._errors = rows, np.zeros((3, len(goals)))
        self._limits = np.array([task.success.still, task.success.withdrawn])
        self._names = [each.name for each in task.objects]
        self.placed, self.held = 0, False
        self._stage, self._best, self._failure, self._over = "start", 0, "", False

    @property
    def motion_index(self) -> float:
        """2k while k objects are in place, 2k + 1 while another one is in the hand."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """True once an object is off the table, or the task's own condition of failure holds."""
        return self._over

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return "success" if self.success else self._stage

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed any more, "" if it can."""
        return self._failure

    def update(self, state: State) -> TaskVerdict:
        """See `Progress`."""
        self._errors = np.empty((3, len(self._goals)))
        poses, moving, tcp = state.object_pose, state.object_velocity, state.tcp_pose
        verdict = TaskVerdict(
            *judge_task(poses, moving, tcp, state.touching, self._goals, self._rows, LOWEST, self._limits, self._errors)
        )
        self.placed, self.held = verdict.placed, verdict.held == 1
        also = self._task.success.also
        done = verdict.placed == len(self._goals) and verdict.quiet == 1
        # asked at every state: it may remember what it has seen
        agreed = also is None or self._holds("also", also)
        self._settle(done and agreed, verdict)
        self._note_stage(state)
        if verdict.fallen:
            self._fail("off_table")
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
            self._best, self._stage = self.placed, f"placed {self.placed} of {len(self._goals)}"
        held = state.touching[FINGERS, FIRST_OBJECT:] != 0.0
        for k in np.flatnonzero(held & (state.object_pose[:, 2] > self._heights + LIFTED)):
            if not self._best:
                self._stage = f"lifted {self._names[k]}"

    def reward(self, state: State) -> float:
        """See `Progress`: the mean over the goals, see `dense_reward.placing`; without goals, that of success."""
        if not len(self._goals):
            return float(self.success)
        rewards, tcp = [], state.tcp_pose[0, :3]
        for row, (across, along, angle) in zip(self._rows, self._errors.T, strict=True):
            thing = int(row[GOAL.thing])
            reach = float(np.linalg.norm(state.object_pose[thing, :3] - tcp))
            held = bool(state.touching[FINGERS, FIRST_OBJECT + thing])
            done = bool(across <= row[GOAL.xy] and along <= row[GOAL.z] and angle <= row[GOAL.angle] and not held)
            away = min(1.0, reach / max(self._limits[1], 1e-6))
            rewards.append(float(placing(reach, float(np.hypot(across, along)), float(angle), held, done, away)))
        return float(np.mean(rewards))

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        wanted = self._task.success.numbers
        numbers = {name: float(self._asked(name, function)) for name, function in wanted.items()}
        position = np.hypot(self._errors[0], self._errors[1])
        return {"placed": self.placed, "position_error": position, "angle_error": self._errors[2].copy(), **numbers}
