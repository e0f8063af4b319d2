"""Conversion of Stable-Baselines3 or plain torch models to actors; needs the extra `rl`, but imports without it."""

from __future__ import annotations

import json
import zipfile
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from gymnasium.spaces import Box

from ...envs import TaskDescription
from ...planner.errors import BadOption
from ...planner.imitation.npz_arrays import UNREADABLE
from ..errors import BadActor
from ..extras import needed
from .actor import Actor, TrainingInfo, actor_for
from .actor_card import METHOD as RESIDUAL
from .actor_card import one_line
from .feature_scaling import Normalization
from .features import Features
from .network import ACTIVATIONS, Network

EXTRA = "rl"
"""Extra of onedemo that brings torch and Stable-Baselines3."""
TRIES, TOLERANCE = 64, 1e-5
"""Number of random features on which actor and model are compared, and largest difference of their actions."""
MAX_DATA = 16 * 2**20
"""Size limit [bytes] of the settings in a zip."""
KINDS = {"target_entropy": "SAC", "clip_range": "PPO"}
"""Algorithms by a key that only their settings in a Stable-Baselines3 zip contain."""


def actor_of(
    model: Any,
    task: TaskDescription,
    *,
    method: str,
    features: Features | None = None,
    normalization: Normalization | None = None,
    residual_scale: Sequence[float] = (),
    config_hash: str = "",
    training: TrainingInfo | None = None,
) -> Actor:
    """Return the actor of a trained model, after checking that it acts as the model does.

    Args:
        model: SAC, TQC or PPO of Stable-Baselines3 with an MLP policy; or a `torch.nn.Sequential` of linear layers with
            ReLU or Tanh between them and, if its output is squashed, Tanh at the end.
        task: `env.unwrapped.task` of the environment it was trained in.
        method: name of the policy that will use the actor, like "sac".
        features: features of its input, in order; None: the entries of its own Dict of boxes, unchanged.
        normalization: scaling of the features; None: unscaled.
        residual_scale: see `Actor`.
        config_hash: see `Actor`.
        training: see `Actor`.

    Raises:
        BadOption: the model is of another kind, or has another input than these features.
        MissingExtra: torch is not installed.
    """
    needed("torch", EXTRA)
    if method == RESIDUAL and not residual_scale:
        raise BadOption("residual_scale", "is missing: give that of the environment it was trained in, env.scale")
    if features is None and isinstance(getattr(model, "observation_space", None), Box):
        raise BadOption("features", "is missing: the model sees a vector; give features and normalization of it")
    if features is None:
        features = Features.raw(getattr(model, "observation_space", None))  # type: ignore[arg-type]
    network = network_of(model)
    if network.sizes[0] != features.size:
        raise BadOption("features", f"has {features.size} numbers; the model sees {network.sizes[0]}")
    worst = _difference(model, network)
    if not worst <= TOLERANCE:
        raise BadOption("model", f"acts otherwise than its layers alone, by up to {worst:.2g}; is it of another kind?")
    return actor_for(
        task,
        network,
        features,
        normalization or Normalization.none(features.size, clip=None),
        method=method,
        residual_scale=tuple(map(float, residual_scale)),
        config_hash=config_hash,
        training=training or TrainingInfo(type(model).__name__, steps=int(getattr(model, "num_timesteps", 0))),
    )


def network_of(model: Any) -> Network:
    """Return the layers of a model; see `actor_of`.

    Raises:
        BadOption: the model is of another kind.
    """
    policy: Any = getattr(model, "policy", None)
    actor: Any = getattr(policy, "actor", None)
    if hasattr(actor, "latent_pi") and hasattr(actor, "mu"):
        return _stacked([*actor.latent_pi, actor.mu], "tanh")
    if hasattr(policy, "mlp_extractor") and hasattr(policy, "action_net"):
        return _stacked([*policy.mlp_extractor.policy_net, policy.action_net], "clip")
    if type(model).__name__ == "Sequential":
        layers = list(model)
        squashed = bool(layers) and type(layers[-1]).__name__ == "Tanh"
        return _stacked(layers[:-1] if squashed else layers, "tanh" if squashed else "clip")
    raise BadOption("model", f"is a {type(model).__name__}; an actor is made of SAC, TQC, PPO or torch.nn.Sequential")


def actor_of_zip(path: Path, task: TaskDescription, *, method: str) -> Actor:
    """Return the actor of a Stable-Baselines3 zip. Reading a zip may run any code its author put into it.

    The zip names neither task nor robot nor control mode: those of `task` are assumed. Nor does it contain the scaling
    of features, so only models that see the environment's own Dict can be read: those of `MultiInputPolicy`.

    Args:
        path: the zip.
        task: `env.unwrapped.task`.
        method: see `actor_of`.

    Raises:
        BadActor: the zip cannot be read, or its model is of another kind.
        MissingExtra: Stable-Baselines3 is not installed.
    """
    library = needed("stable_baselines3", EXTRA)
    kind = _kind(path)
    try:
        model = getattr(library, kind).load(path, device="cpu", custom_objects={"buffer_size": 1})
    except Exception as error:
        said = one_line(f"{type(error).__name__}: {error}")
        raise BadActor(path, "file", f"Stable-Baselines3 cannot read it as {kind} ({said})") from None
    if not hasattr(model.observation_space, "spaces"):
        reason = "is a flat box, and the zip does not say of what: export it (onedemo.baselines.actor_of)"
        raise BadActor(path, "observation_space", reason)
    try:
        return actor_of(model, task, method=method)
    except BadOption as error:
        raise BadActor(path, error.option, error.reason) from None


def _kind(path: Path) -> str:
    """Return the algorithm of a zip, from its settings: these are JSON, so that reading them runs no code."""
    try:
        with zipfile.ZipFile(path) as archive, archive.open("data") as file:
            settings = json.loads(file.read(MAX_DATA))
    except (KeyError, RecursionError, *UNREADABLE) as error:
        raise BadActor(path, "data", f"is not that of Stable-Baselines3 ({one_line(str(error))})") from None
    for key, kind in KINDS.items():
        if isinstance(settings, dict) and key in settings:
            return kind
    raise BadActor(path, "data", f"is of no algorithm that is read: {', '.join(KINDS.values())}")


def _stacked(modules: list[Any], output: str) -> Network:
    """Return the network of linear layers with one activation between all of them."""
    linear, between = modules[::2], {type(module).__name__.lower() for module in modules[1::2]}
    for k, module in enumerate(modules):
        name, allowed = type(module).__name__, ("ReLU", "Tanh") if k % 2 else ("Linear",)
        if name not in allowed or (k % 2 and len(between) > 1):
            others = f" among {', '.join(sorted(between))}" if k % 2 else ""
            raise BadOption("model", f"its layer {k} is {name}{others}; expected {' or '.join(allowed)}, all alike")
    if len(modules) % 2 == 0:
        raise BadOption("model", f"has {len(modules)} layers; expected linear ones and an activation between each two")
    weights = [module.weight.detach().cpu().numpy() for module in linear]
    biases = [
        np.zeros(len(weight)) if module.bias is None else module.bias.detach().cpu().numpy()
        for module, weight in zip(linear, weights, strict=True)
    ]
    return Network(tuple(weights), tuple(biases), *(between or {ACTIVATIONS[0]}), output=output)


def _difference(model: Any, network: Network) -> float:
    """Return the largest difference between the actions of a model and of its layers, on random features."""
    rng = np.random.default_rng(0)
    features = rng.normal(size=(TRIES, network.sizes[0])).astype(np.float32)
    own = np.array([network(row) for row in features])
    if type(model).__name__ == "Sequential":
        torch = needed("torch", EXTRA)
        with torch.no_grad():
            given = torch.as_tensor(features, device=next(model.parameters()).device)
            theirs = np.clip(model(given).cpu().numpy(), -1.0, 1.0)
    else:
        theirs = model.predict(_observed(model.observation_space, features), deterministic=True)[0]
    return float(np.abs(own - theirs).max()) if theirs.shape == own.shape else np.inf


def _observed(space: Any, features: np.ndarray) -> Any:
    """Convert features (n, size) to the observations from which a model takes them."""
    if not hasattr(space, "spaces"):
        return features.reshape(len(features), *space.shape)
    ends = np.cumsum([int(np.prod(entry.shape)) for entry in space.spaces.values()])
    parts = np.split(features, ends[:-1], axis=1)
    return {
        key: part.reshape(len(features), *entry.shape)
        for (key, entry), part in zip(space.spaces.items(), parts, strict=True)
    }
