"""Learned actors: a network, its features, and the conditions under which it may act."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from ...envs import TaskDescription
from ...planner.errors import BadOption
from ..policy import Observation
from .feature_scaling import Normalization
from .features import Features
from .network import Network

PACKAGES = ("onedemo", "numpy", "gymnasium", "mujoco", "robosuite", "torch", "stable_baselines3", "sb3_contrib")
"""Packages whose versions an actor records."""
TWIST = 6
"""Entries of a tcp twist."""


@dataclass(frozen=True, slots=True)
class TrainingInfo:
    """Origin of an actor, for readers and reports; nothing depends on it.

    Attributes:
        algorithm: name like "SAC".
        steps: environment steps, demonstrations included.
        seed: seed of the training.
        demonstrations: number of demonstrations seen.
        success: share of successful episodes at the end; None: not measured.
        episodes: number of episodes in that measurement.
        seconds: real time [s].
        settings: settings of the algorithm; numbers, texts, truth values or None.
    """

    algorithm: str
    steps: int = 0
    seed: int = 0
    demonstrations: int = 0
    success: float | None = None
    episodes: int = 0
    seconds: float = 0.0
    settings: Mapping[str, float | int | str | bool | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, eq=False)
class Actor:
    """Learned policy without its algorithm.

    Attributes:
        method: name of the policy, like "sac".
        task: name of the task it was trained on.
        robot: robosuite's name of the robot it was trained with.
        control_mode: meaning of its actions: "joint_velocity" or "ee_twist".
        frequency: rate of its actions [Hz].
        features: features of the observation it sees.
        normalization: scaling of the features.
        network: network from scaled features to an action in [-1, 1].
        residual_scale: (m,) weights of the network's action where it is added to another policy's action, relative to
            the speed of that policy's fastest joint; see `residual_policy.corrected`. (): the network acts alone.
        config_hash: digest of its training's config, or "".
        versions: versions of the packages it was trained with, by name.
        training: see `TrainingInfo`.

    Raises:
        BadOption: the parts do not fit together.
    """

    method: str
    task: str
    robot: str
    control_mode: str
    frequency: int
    features: Features
    normalization: Normalization
    network: Network
    residual_scale: tuple[float, ...] = ()
    config_hash: str = ""
    versions: Mapping[str, str] = field(default_factory=dict)
    training: TrainingInfo = TrainingInfo("")

    def __post_init__(self):
        size, sizes = self.features.size, self.network.sizes
        for key, count in (("normalization", len(self.normalization.mean)), ("network", sizes[0])):
            if count != size:
                raise BadOption(key, f"is for {count} features; there are {size}")
        if self.residual_scale and len(self.residual_scale) != sizes[-1]:
            raise BadOption("residual_scale", f"has {len(self.residual_scale)} entries; the action has {sizes[-1]}")
        if not np.isfinite(self.residual_scale).all():
            raise BadOption("residual_scale", f"{self.residual_scale} is not finite")

    @property
    def actions(self) -> int:
        """Number of entries of an action."""
        return self.network.sizes[-1]

    def __call__(self, observation: Observation) -> np.ndarray:
        """Return the action (actions,) float32, in [-1, 1], for one observation."""
        return self.network(self.normalization(self.features(observation)))

    def misfit(self, method: str, task: TaskDescription) -> tuple[str, str] | None:
        """Return the first property of a task that this actor was not made for, as key and reason, or None.

        Only properties known before the first observation are checked; see `unseen` for the others.

        Args:
            method: name of the policy that is to use the actor.
            task: the task.
        """
        entries = len(task.arms) * ((TWIST if task.control_mode == "ee_twist" else task.arms[0].dof) + 1)
        for key, own, wanted, unit, argument in (
            ("method", self.method, method, "", ""),
            ("task", self.task, task.name, "", ""),
            ("robot", self.robot, task.robot, "", ""),
            ("control.mode", self.control_mode, task.control_mode, "", "control_mode"),
            ("control.frequency", self.frequency, frequency_of(task), " Hz", "control_frequency"),
            ("action.shape", (self.actions,), (entries,), "", ""),
        ):
            if own != wanted:
                remedy = f": it acts with the environment's {argument}={own}" if argument else ""
                return key, f"is {own!r}{unit}; wanted is {wanted!r}{unit}{remedy}"
        arms, objects = len(task.arms), len(task.objects)
        known = {"joint_positions": (arms, task.arms[0].dof), "tcp_pose": (arms, 7), "object_pose": (objects, 7)}
        return self.unseen(known, partly=True)

    def unseen(self, shapes: Mapping[str, tuple[int, ...]], *, partly: bool = False) -> tuple[str, str] | None:
        """Return the first observation entry that is missing or has another shape, as key and reason, or None.

        Args:
            shapes: shapes of the known entries, by name.
            partly: `shapes` is incomplete: accept missing entries.
        """
        for key, shape in self.features.shapes:
            if key not in shapes and not partly:
                return f"observation.{key}", f"is not among the entries that there are: {', '.join(shapes)}"
            if key in shapes and tuple(shapes[key]) != shape:
                return f"observation.{key}", f"has shape {shape}; here it has {tuple(shapes[key])}"
        return None


def frequency_of(task: TaskDescription) -> int:
    """Return the number of actions per second."""
    return round(1.0 / task.control_dt)


def versions_now() -> dict[str, str]:
    """Return the versions of Python and of the installed packages of `PACKAGES`."""
    found = {"python": platform.python_version()}
    for name in PACKAGES:
        try:
            found[name] = version(name)
        except PackageNotFoundError:
            continue
    return found


def actor_for(
    task: TaskDescription, network: Network, features: Features, normalization: Normalization, **more: Any
) -> Actor:
    """Return an actor for a task, with the current package versions.

    Args:
        task: `env.unwrapped.task`.
        network: see `Actor`.
        features: see `Actor`.
        normalization: see `Actor`.
        more: `method`, and further attributes of `Actor`.
    """
    return Actor(
        task=task.name,
        robot=task.robot,
        control_mode=task.control_mode,
        frequency=frequency_of(task),
        features=features,
        normalization=normalization,
        network=network,
        versions=versions_now(),
        **more,
    )
