"""Metadata of an actor: everything except its weights, as a JSON table, read strictly. Keys: docs/learning.md."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, fields
from typing import Any, NamedTuple

import numpy as np

from ...planner.strict_json import Refused, list_of, number_of, numbers_of, table_of, text_of, texts_of
from .actor import Actor, TrainingInfo
from .feature_scaling import Normalization
from .features import Features

FORMAT_VERSION = 1
MAX_NUMBER, MAX_LAYERS, MAX_TEXT = 2**53, 16, 300
KEYS = (
    "format_version", "method", "task", "robot", "control", "observation", "action", "features", "network",
    "residual_scale", "config_hash", "versions", "training", "weights",
)  # fmt: skip


class Card(NamedTuple):
    """Table that has been read.

    Attributes:
        actor: arguments of `Actor`, except for its network.
        sizes: sizes of the network's layers, its input first.
        activation: see `Network`.
        output: see `Network`.
        bytes: size of the weights file.
        sha256: SHA-256 of the weights file.
    """

    actor: dict[str, Any]
    sizes: tuple[int, ...]
    activation: str
    output: str
    bytes: int
    sha256: str


def card_of(actor: Actor, size: int, digest: str) -> dict[str, Any]:
    """Return the table of an actor.

    Args:
        actor: the actor.
        size: size of its weights file in bytes.
        digest: SHA-256 of its weights file.
    """
    normalization, network = actor.normalization, actor.network
    return {
        "format_version": FORMAT_VERSION,
        "method": actor.method,
        "task": actor.task,
        "robot": actor.robot,
        "control": {"mode": actor.control_mode, "frequency": actor.frequency},
        "observation": {key: list(shape) for key, shape in actor.features.shapes},
        "action": {"shape": [actor.actions], "low": -1.0, "high": 1.0},
        "features": {
            "blocks": list(actor.features.blocks),
            "names": list(actor.features.names),
            "mean": normalization.mean.tolist(),
            "scale": normalization.scale.tolist(),
            "clip": normalization.clip,
        },
        "network": {"sizes": list(network.sizes), "activation": network.activation, "output": network.output},
        "residual_scale": list(actor.residual_scale),
        "config_hash": actor.config_hash,
        "versions": dict(actor.versions),
        "training": {**asdict(actor.training), "settings": dict(actor.training.settings)},
        "weights": {"bytes": size, "sha256": digest},
    }


def read_card(value: Any) -> Card:
    """Read the table of an actor.

    Raises:
        Refused: the first unexpected key.
        OneDemoError: features or scales that no actor can have.
    """
    if isinstance(value, dict) and value.get("format_version", FORMAT_VERSION) != FORMAT_VERSION:
        raise Refused("format_version", f"is {value['format_version']!r}; this program reads {FORMAT_VERSION}")
    card = table_of("", value, KEYS)
    control = table_of("control", card["control"], ("mode", "frequency"))
    weights = table_of("weights", card["weights"], ("bytes", "sha256"))
    features, normalization = _features(card)
    actor = {
        **{key: text_of(key, card[key]) for key in ("method", "task", "robot", "config_hash")},
        "control_mode": text_of("control.mode", control["mode"]),
        "frequency": _whole("control.frequency", control["frequency"], 1),
        "features": features,
        "normalization": normalization,
        "residual_scale": tuple(numbers_of("residual_scale", card["residual_scale"], (None,)).tolist()),
        "versions": {key: text_of(f"versions.{key}", entry) for key, entry in _table("versions", card).items()},
        "training": _training(card["training"]),
    }
    size, digest = _whole("weights.bytes", weights["bytes"], 0), text_of("weights.sha256", weights["sha256"])
    return Card(actor, *_architecture(card, features.size), size, digest)


def one_line(text: str) -> str:
    """Return an untrusted text as one printable line of limited length."""
    shown = "".join(sign if sign.isprintable() else " " for sign in text[: MAX_TEXT + 1])
    return shown if len(shown) <= MAX_TEXT else f"{shown[:MAX_TEXT]}…"


def _features(card: Mapping[str, Any]) -> tuple[Features, Normalization]:
    shapes = []
    for key, shape in _table("observation", card).items():
        entries = list_of(f"observation.{key}", shape)
        shapes.append((key, tuple(_whole(f"observation.{key}[{k}]", n, 0) for k, n in enumerate(entries))))
    table = table_of("features", card["features"], ("blocks", "names", "mean", "scale", "clip"))
    features = Features(tuple(shapes), texts_of("features.blocks", table["blocks"]))
    if spare := sorted({key for key, _ in shapes} - {key for key, _ in features.shapes}):
        raise Refused(f"observation.{spare[0]}", "is in none of features.blocks")
    names = texts_of("features.names", table["names"])
    # checked before `features.names` is built, since untrusted shapes may claim any number of entries
    if len(names) != features.size:
        raise Refused("features.names", f"has {len(names)} entries; the blocks have {features.size}")
    for k, (name, expected) in enumerate(zip(names, features.names, strict=True)):
        if name != expected:
            raise Refused(f"features.names[{k}]", f"is {name!r}; this program sees {expected!r} there")
    mean, scale = (numbers_of(f"features.{key}", table[key], (len(names),)) for key in ("mean", "scale"))
    clip = None if table["clip"] is None else number_of("features.clip", table["clip"])
    with np.errstate(over="ignore"):
        return features, Normalization(mean, scale, clip)


def _architecture(card: Mapping[str, Any], inputs: int) -> tuple[tuple[int, ...], str, str]:
    table = table_of("network", card["network"], ("sizes", "activation", "output"))
    entries = list_of("network.sizes", table["sizes"])
    if not 2 <= len(entries) <= MAX_LAYERS + 1:
        raise Refused("network.sizes", f"has {len(entries)} entries; allowed are 2 to {MAX_LAYERS + 1}")
    sizes = [_whole(f"network.sizes[{k}]", size, 1) for k, size in enumerate(entries)]
    if sizes[0] != inputs:
        raise Refused("network.sizes[0]", f"is {sizes[0]}; there are {inputs} features")
    action = table_of("action", card["action"], ("shape", "low", "high"))
    shape = [_whole(f"action.shape[{k}]", n, 1) for k, n in enumerate(list_of("action.shape", action["shape"]))]
    if shape != sizes[-1:]:
        raise Refused("action.shape", f"is {shape}; the network gives {sizes[-1:]}")
    for key, bound in (("low", -1.0), ("high", 1.0)):
        if number_of(f"action.{key}", action[key]) != bound:
            raise Refused(f"action.{key}", f"is {action[key]}; actions are in [-1, 1]")
    return tuple(sizes), text_of("network.activation", table["activation"]), text_of("network.output", table["output"])


def _training(value: Any) -> TrainingInfo:
    table = table_of("training", value, tuple(field.name for field in fields(TrainingInfo)))
    success = None if table["success"] is None else number_of("training.success", table["success"])
    settings = table["settings"]
    for key, entry in _table("settings", table, "training.").items():
        if isinstance(entry, float):
            number_of(f"training.settings.{key}", entry)
        elif not isinstance(entry, bool | int | str | None):
            raise Refused(f"training.settings.{key}", "is neither a number, a text, true, false nor null")
    counts = {key: _whole(f"training.{key}", table[key], 0) for key in ("steps", "seed", "demonstrations", "episodes")}
    return TrainingInfo(
        algorithm=text_of("training.algorithm", table["algorithm"]),
        success=success,
        seconds=number_of("training.seconds", table["seconds"]),
        settings=settings,
        **counts,
    )


def _table(key: str, tables: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """Return a table with arbitrary keys."""
    if not isinstance(tables[key], dict):
        raise Refused(f"{prefix}{key}", "is not a table")
    return tables[key]


def _whole(key: str, value: Any, least: int) -> int:
    """Return a whole number."""
    if isinstance(value, bool) or not isinstance(value, int) or not least <= value <= MAX_NUMBER:
        raise Refused(key, f"is {one_line(repr(value))}, not a whole number from {least} on")
    return value


METHOD = "residual"
"""Name of the method whose actors correct another policy."""
