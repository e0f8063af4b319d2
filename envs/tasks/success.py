"""Success of a user's own task, as data and predicates, and the scene that predicates look at."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import UnknownName
from ..simulation.simulation import Simulation
from ..simulation.state import State


@dataclass(frozen=True)
class Tolerance:
    """Largest errors of an object at its goal.

    Attributes:
        xy: distance across the goal's z axis [m].
        z: distance along it [m].
        angle: angle [rad]; turns after which the object looks the same do not count.
    """

    xy: float = 0.010
    z: float = 0.005
    angle: float = math.radians(10.0)


class SceneView:
    """The scene as the simulator has it, for predicates.

    Attributes:
        seconds: time [s] since the start.
        memory: anything that predicates want to remember until the end of the episode; empty at the start.
    """

    def __init__(self, names: tuple[str, ...], fixtures: Mapping[str, Pose], goals: Mapping[str, Pose]):
        self._names, self._fixtures, self._goals = names, fixtures, goals
        self.seconds = 0.0
        self.memory: dict[str, Any] = {}
        self._state: State | None = None
        self._sim: Simulation | None = None
        self._pairs: frozenset[frozenset[str]] | None = None

    def see(self, state: State, sim: Simulation, seconds: float) -> None:
        """Take over a new state.

        Args:
            state: the state.
            sim: the simulation that is in this state.
            seconds: time since the start [s].
        """
        self._state, self._sim, self._pairs, self.seconds = state, sim, None, seconds

    @property
    def state(self) -> State:
        """The measured state."""
        assert self._state is not None
        return self._state

    @property
    def tcp(self) -> Pose:
        """Pose of the point between the finger pads."""
        return Pose.from_vector(self.state.tcp_pose[0])

    @property
    def opening(self) -> float:
        """Gap between the finger pads [m]."""
        return float(self.state.gripper_opening[0])

    def pose(self, name: str) -> Pose:
        """Return the pose of a movable thing or a fixture."""
        if name in self._fixtures:
            return self._fixtures[name]
        return Pose.from_vector(self.state.object_pose[self._index(name)])

    def goal(self, name: str) -> Pose:
        """Return the goal of a movable thing."""
        if name not in self._goals:
            raise UnknownName("goal of", name, self._goals)
        return self._goals[name]

    def speed(self, name: str) -> float:
        """Return the speed of a movable thing [m/s]."""
        return float(np.linalg.norm(self.state.object_velocity[self._index(name)]))

    def touching(self, one: str, other: str) -> bool:
        """Return whether two things touch: movable ones, fixtures, "table", "fingers", or links of the robot by name.

        Args:
            one: name of a thing.
            other: name of another thing.
        """
        if self._pairs is None:
            assert self._sim is not None
            geoms, labels = self._sim.data.contact.geom, self._sim.scene.labels
            self._pairs = frozenset(frozenset((labels[int(a)], labels[int(b)])) for a, b in geoms)
        return frozenset((one, other)) in self._pairs

    def held(self, name: str) -> bool:
        """Return whether the fingers touch a movable thing."""
        return self.touching("fingers", name)

    def _index(self, name: str) -> int:
        if name not in self._names:
            raise UnknownName("thing", name, (*self._names, *self._fixtures))
        return self._names.index(name)


Predicate = Callable[[SceneView], bool]
"""Function of the scene."""


@dataclass(frozen=True)
class Success:
    """When a task is done, as the simulator shows it.

    For `seconds` without interruption every object with a goal is within its tolerance, touched by no finger and at
    rest, the hand has withdrawn, and `also` holds.

    Attributes:
        tolerances: by object; those with a goal that are not named have the defaults of `Tolerance`.
        withdrawn: least distance [m] of the tcp from the frame of every object with a goal.
        still: largest speed [m/s] of an object at rest.
        seconds: time [s] for which all this must hold.
        in_order: whether objects only count as in place once those before them, in the order of the goals, are.
        undisturbed: objects that must stay where they are, with how far they may be moved: distance [m] and turn [rad].
        also: further condition; None: none. Without goals it is the only one.
        failed: reasons, each with the condition under which the task cannot succeed any more.
        numbers: numbers for `info` and reports, by name.
    """

    tolerances: Mapping[str, Tolerance] = field(default_factory=dict)
    withdrawn: float = 0.05
    still: float = 0.01
    seconds: float = 0.5
    in_order: bool = False
    undisturbed: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    also: Predicate | None = None
    failed: tuple[tuple[str, Predicate], ...] = ()
    numbers: Mapping[str, Callable[[SceneView], float]] = field(default_factory=dict)
