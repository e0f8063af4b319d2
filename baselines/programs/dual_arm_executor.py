"""Two arms that hold objects from the start and move together: generators that yield an action per tick.

Both follow their paths at the same index, so that the relative motion of the hands is as planned; the safety layer of
both arms filters every command. There are no detours: obstacles stop the arms.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from ...envs import TaskDescription
from ...planner import Controller, Pose, PosePath, SafetyLayer
from ...planner.collision.robot_arrays import ROW
from ...planner.collision.self_collision import pairs_of
from ...planner.errors import PlanFailed
from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import METERS_PER_RADIAN
from ...planner.resumable import Resumable
from ...planner.safety.safety_layer import BLOCKED
from ..motion.motion_method import MotionMethod
from ..motion.settings import ProgramSettings
from ..policy import LabeledPath, Observation
from .thought import T, Thought, thought
from .world_model import OBSTACLE_KEYS, TABLE, TABLE_MARGIN, obstacles_in

CLOSE = 1.0
WRIST = 3
"""Within one arm, only capsules at least this many joints apart are checked: across a wrist they are always close."""
NEAR = 0.02
"""Distance [rad] of every joint to the next point of a joint-space path at which that point counts as reached."""
SLICE, STEP = 8, 300.0
"""Steps of a roll-out between two pauses, and the cost [us] of one, see `planner.resumable`."""
Paths = tuple[PosePath, PosePath]


class DualArmRollOut(NamedTuple):
    """Result of a kinematic run along two paths.

    Attributes:
        reason: "" if both arrived, else "blocked" or "ik_or_limit".
        q: (2, dof) joints at its end [rad].
        margin: smallest distance to a joint limit on the way [rad].
    """

    reason: str
    q: np.ndarray
    margin: float


class DualArmExecutor:
    """Commanded joints of two arms with their held objects, and the latest observation.

    Args:
        task: the task, with the arms and their bodies.
        settings: see `ProgramSettings`.
        observation: the first one.
        motion_method: method of executing motions.

    Attributes:
        q: (2, dof) commanded joints [rad].
        before: (2, dof) commanded joints [rad] before the last action.
        observation: the latest; updated by the policy before each tick.
        drawn: always empty, see `ArmExecutor`.
    """

    drawn: tuple[LabeledPath, ...] = ()

    def __init__(
        self, task: TaskDescription, settings: ProgramSettings, observation: Observation, motion_method: MotionMethod
    ):
        self.task, self.settings, self._safety, self.motion_method = (
            task,
            settings.motion,
            settings.safety,
            motion_method,
        )
        self._guard, self._budget = settings.guard, settings.reactive.budget
        self.observation, self.arms = observation, task.arms
        self.q = self.before = np.array(observation["joint_positions"], dtype=np.float64)
        self._bodies, self._pairs = task.bodies, pairs_of(task.arms, task.bodies, apart=WRIST)
        self._fixed = tuple(replace(f, margin=TABLE_MARGIN) if f.name == TABLE else f for f in task.fixtures)
        self._controllers = [Controller(arm, settings.motion.controller) for arm in task.arms]
        self._rows, self._layer = np.zeros(0), self._renewed_layer()

    def held(self, arm: int, index: int) -> Pose:
        """Return the observed `tcp_from_object`.

        Args:
            arm: index of the arm.
            index: index of the object.
        """
        tcp = Pose.from_vector(self.observation["tcp_pose"][arm])
        return tcp.inverse() @ Pose.from_vector(self.observation["object_pose"][index])

    def hold(self, held: Sequence[Pose]) -> None:
        """Set `tcp_from_object` of object k in hand k from now on; the two objects may come near each other."""
        objects = self.task.objects
        self._bodies = tuple(
            body.holding(each.name, each.shape, pose, arm)
            for body, each, pose, arm in zip(self.task.bodies, objects, held, self.arms, strict=True)
        )
        names = [name for body in self._bodies for name in body.names]
        meant = {each.name for each in objects}
        pairs = pairs_of(self.arms, self._bodies, apart=WRIST)
        self._pairs = [(i, j) for i, j in pairs if names[i] == names[j] or not {names[i], names[j]} <= meant]
        self._layer = self._renewed_layer()

    def move(self, paths: Paths, radius: float) -> Iterator[np.ndarray]:
        """Move both hands along paths, or to their ends by the motion method's own joint-space path.

        Args:
            paths: paths of the two tcps, equally many poses.
            radius: see `follow` [m].

        Raises:
            PlanFailed: as `follow`; also if no joint-space path is found.
        """
        ends = [path[-1] for path in paths]
        path = self.motion_method.dual_arm_path(self.arms, self.q, ends, self._seen, self.settings.dt)
        if path is None:
            return self.follow(paths, radius)
        if isinstance(path, str):
            reason = "ik_or_limit" if path == "ik_or_limit" else "blocked"
            raise PlanFailed(reason, "no way of both arms through joint space was found")
        return self._follow_joints(path)

    def _follow_joints(self, path: np.ndarray) -> Iterator[np.ndarray]:
        """Follow joints (t, 2, dof) as far as the safety layer permits."""
        index, waited = 0, 0.0
        while index < len(path):
            wanted = (path[index] - self.q).ravel() / self.settings.dt
            yield self._action(self._layer(self.q.ravel(), wanted).velocity.reshape(self.q.shape))
            waited += self.settings.dt
            if np.abs(self.q - path[index]).max() < NEAR:
                index, waited = index + 1, 0.0
            elif waited > self.settings.pursuit.patience:
                raise PlanFailed("blocked", f"no progress at {index / len(path):.0%} of the way of both hands")

    def follow(self, paths: Paths, radius: float) -> Iterator[np.ndarray]:
        """Follow two paths pose by pose.

        Args:
            paths: paths of the two tcps, equally many poses.
            radius: path length [m] to its pose within which each hand must be before the next pair of poses.

        Raises:
            PlanFailed: "blocked" or "ik_or_limit", no progress for the settings' patience.
        """
        index, waited = 0, 0.0
        while index < len(paths[0]):
            self._look()
            speeds, blocked = self._towards(paths, index)
            yield self._action(speeds)
            waited += self.settings.dt
            if self._gap(paths, index) < radius:
                index, waited = index + 1, 0.0
            elif waited > self.settings.pursuit.patience:
                reason = "blocked" if blocked else "ik_or_limit"
                raise PlanFailed(reason, f"no progress at {index / len(paths[0]):.0%} of the way of both hands")

    def wait(self, seconds: float) -> Iterator[np.ndarray]:
        """Stand still."""
        for _ in range(round(seconds / self.settings.dt)):
            yield self.still()

    def still(self) -> np.ndarray:
        """Return the action of standing still, or of retreating from approaching obstacles."""
        return self._action(self._standing(self.q))

    def hold_still(self) -> np.ndarray:
        """See `ArmExecutor`."""
        here = self.before
        action = self._action(self._standing(here))
        self.before = here + self.q - self.before
        return action

    def _standing(self, q: np.ndarray) -> np.ndarray:
        """Return safe speeds (2, dof) of standing still at joints (2, dof)."""
        self._look()
        return self._layer(q.ravel(), np.zeros(q.size)).velocity.reshape(q.shape)

    def roll_out(self, paths: Paths, radius: float) -> Resumable[DualArmRollOut]:
        """Predict the result of following two paths from now on, by kinematics alone, in slices; nothing is moved.

        Args:
            paths: paths of the two tcps, equally many poses.
            radius: see `follow` [m].
        """
        margin, reason, steps = np.inf, "", self.move(paths, radius)
        there, over = (self.q, self._renewed_layer()), False
        there[1].work[ROW.previous] = self._layer.work[ROW.previous]
        while not over:
            here, (self.q, self._layer) = (self.q, self._layer), there
            try:
                for _ in range(SLICE):
                    if next(steps, None) is None:
                        over = True
                        break
                    margin = min(margin, *(arm.margin(q) for arm, q in zip(self.arms, self.q, strict=True)))
            except PlanFailed as failure:
                over, reason = True, failure.reason
            there, (self.q, self._layer) = (self.q, self._layer), here
            yield SLICE * STEP
        for controller in self._controllers:
            controller.reset()
        return DualArmRollOut(reason, there[0], margin)

    def thought(self, work: Resumable[T]) -> Thought[T]:
        """Stand still during a computation; return its result."""
        return thought(work, self._budget, self.still)

    def _towards(self, paths: Paths, index: int) -> tuple[np.ndarray, bool]:
        """Return safe speeds (2, dof) towards a pose of each path, and whether an obstacle blocks them."""
        each = zip(self._controllers, self.q, paths, strict=True)
        wanted = np.array([controller(q, path[index]) for controller, q, path in each])
        filtered = self._layer(self.q.ravel(), wanted.ravel())
        near = filtered.slack < self._safety.distance
        return filtered.velocity.reshape(self.q.shape), filtered.status == BLOCKED or near

    def _gap(self, paths: Paths, index: int) -> float:
        """Return the larger path length [m] of the two hands to a pose of their paths."""
        gaps = [
            dq.pose_distance(arm.fk(q).dq, path.dqs[index])
            for arm, q, path in zip(self.arms, self.q, paths, strict=True)
        ]
        return max(float(np.hypot(distance, METERS_PER_RADIAN * angle)) for distance, angle in gaps)

    def _action(self, speeds: np.ndarray) -> np.ndarray:
        limits = np.array([arm.velocity_limits for arm in self.arms])
        normalized = np.clip(speeds / limits, -1.0, 1.0)
        self.before, self.q = self.q, self.q + self.settings.dt * normalized * limits
        return np.column_stack([normalized, np.full(len(self.q), CLOSE)]).ravel()

    def _look(self) -> None:
        """Make the safety layer anew where an obstacle has changed."""
        rows = np.concatenate([self.observation[key].ravel() for key in OBSTACLE_KEYS])
        if not np.array_equal(rows, self._rows):
            self._rows, self._layer = rows, self._renewed_layer()

    def _seen(self) -> np.ndarray:
        """Return both arms among all obstacles, with or without guard."""
        return self._renewed_layer(guard=True).work

    def _renewed_layer(self, *, guard: bool = False) -> SafetyLayer:
        around = (*self._fixed, *obstacles_in(self.observation))
        allowed = self.task.touching
        pairs = self._pairs
        if not (guard or self._guard):
            around, allowed, pairs = (), (), []
        return SafetyLayer(
            self.arms, self._bodies, around, self.settings.dt, settings=self._safety, allowed=allowed, pairs=pairs
        )
