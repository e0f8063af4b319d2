"""What has been learned: a network, the features it sees, and all that says where it may act."""

from __future__ import annotations

import platform
from collections.abc import Mapping
from dataclasses import dataclass, field
from importlib.metadata import PackageNotFoundError, version
from typing import Any

import numpy as np

from ...envs.core.description import TaskDescription
from ...planner.errors import BadOption
from ..policy import Observation
from .feature_scaling import Normalization
from .features import Features
from .network import Network

PACKAGES = ("onedemo", "numpy", "gymnasium", "mujoco", "robosuite", "torch", "stable_baselines3", "sb3_contrib")
"""Whose versions an actor remembers."""
TWIST = 6
"""Entries of a tcp twist."""


@dataclass(frozen=True, slots=True)
class TrainingInfo:
    """How an actor came about; for the reader and for reports, nothing depends on it.

    Attributes:
        algorithm: like "SAC".
        steps: of the environment, demonstrations included.
        seed: of the training.
        demonstrations: how many it has seen.
        success: share of the episodes in which it succeeded when it was done; None: not measured.
        episodes: in how many that was measured.
        seconds: real time.
        settings: of the algorithm; numbers, texts, truth values or None.
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
    """A learned policy without its algorithm.

    Attributes:
        method: the policy's name, like "sac".
        task: name of the task it was trained on.
        robot: robosuite's name of the robot it was trained with.
        control_mode: what its actions say: "joint_velocity" or "ee_twist".
        frequency: of its actions [Hz].
        features: what it sees.
        normalization: of the features.
        network: from scaled features to an action in [-1, 1].
        residual_scale: per entry of the action, how much of the network's is added to another policy's, times the
            speed of its fastest joint, see `residual.corrected`; (): the network's action is the action.
        config_hash: of the settings of its training, "" if there are none.
        versions: of the packages it was trained with, by name.
        training: see `TrainingInfo`.

    Raises:
        BadOption: parts that do not fit together.
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
        """How many entries an action has."""
        return self.network.sizes[-1]

    def __call__(self, observation: Observation) -> np.ndarray:
        """The action (actions,) float32, in [-1, 1], of one observation."""
        return self.network(self.normalization(self.features(observation)))

    def misfit(self, method: str, task: TaskDescription) -> tuple[str, str] | None:
        """Of what is known of a task beforehand, the first thing this actor is not made for: its key and a reason."""
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
        """The first entry of the observation that is missing or of another shape: its key and a reason.

        Args:
            shapes: of the entries that there are.
            partly: what is missing may be there all the same.
        """
        for key, shape in self.features.shapes:
            if key not in shapes and not partly:
                return f"observation.{key}", f"is not among the entries that there are: {', '.join(shapes)}"
            if key in shapes and tuple(shapes[key]) != shape:
                return f"observation.{key}", f"has shape {shape}; here it has {tuple(shapes[key])}"
        return None


def frequency_of(task: TaskDescription) -> int:
    """Actions per second."""
    return round(1.0 / task.control_dt)


def versions_now() -> dict[str, str]:
    """The versions of Python and of those of `PACKAGES` that are installed."""
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
    """An actor for a task, with the versions of now.

    Args:
        task: `env.unwrapped.task`.
        network: see `Actor`.
        features: see `Actor`.
        normalization: see `Actor`.
        more: `method`, and what else of `Actor` is known.
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
