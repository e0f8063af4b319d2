"""Actors as files: NAME.json, and NAME.safetensors for the weights. Reading never runs code.

The .json states the size and the SHA-256 of the weights, so that a truncated, modified or foreign file is refused
before it is parsed as weights; see docs/learning.md.
"""

from __future__ import annotations

import hashlib
import json
import math
from pathlib import Path

import numpy as np

from ...planner.errors import OneDemoError
from ...planner.strict_json import Refused, parsed
from ..errors import BadActor
from .actor import Actor
from .actor_card import Card, card_of, one_line, read_card
from .network import Network

MAX_BYTES, MAX_CARD_BYTES, MAX_HEADER_BYTES = 64 * 2**20, 2**20, 64 * 2**10
"""Size limits of the weights, of the .json, and of the header of the weights."""
CARD, WEIGHTS = ".json", ".safetensors"
FOREIGN = {
    b"PK\x03\x04": "is a zip archive, as Stable-Baselines3 saves models: it holds pickles, and reading one may run "
    "anything. Only if you trust its author: allow_pickle=true (needs 'onedemo[rl]'); better, have it exported",
    b"\x80": "is a pickle, which may run anything when it is read; an actor is NAME.json beside NAME.safetensors",
}
"""First bytes of files often mistaken for an actor, and the reasons given for refusing them."""


def save_actor(actor: Actor, path: str | Path) -> Path:
    """Write an actor; each file appears only when it is complete, the .json last.

    Args:
        actor: the actor.
        path: NAME or NAME.json; or an existing folder, in which NAME is "actor".

    Returns:
        Path of the .json.

    Raises:
        BadActor: the actor is too large, or cannot be written there.
    """
    from safetensors.numpy import save

    stem = _stem(Path(path))
    network = actor.network
    arrays = {}
    for k, pair in enumerate(zip(network.weights, network.biases, strict=True)):
        arrays.update(zip(_names(k), pair, strict=True))
    weights = save(arrays)
    if len(weights) > MAX_BYTES:
        raise BadActor(_beside(stem, WEIGHTS), "file", f"would have {len(weights)} bytes; at most {MAX_BYTES} are read")
    card = card_of(actor, len(weights), hashlib.sha256(weights).hexdigest())
    lines = [f"{json.dumps(key)}: {json.dumps(value, allow_nan=False)}" for key, value in card.items()]
    text = "{\n" + ",\n".join(lines) + "\n}\n"
    for suffix, data in ((WEIGHTS, weights), (CARD, text.encode())):
        target = _beside(stem, suffix)
        part = target.with_name(f"{target.name}.part")
        try:
            part.write_bytes(data)
            part.replace(target)
        except OSError as error:
            raise BadActor(target, "file", f"cannot be written ({error.strerror})") from None
        finally:
            part.unlink(missing_ok=True)
    return _beside(stem, CARD)


def load_actor(path: str | Path) -> Actor:
    """Read an actor.

    Args:
        path: NAME, NAME.json or NAME.safetensors; or a folder that contains "actor".

    Raises:
        BadActor: a file or one of its entries cannot be used; the message names both.
    """
    path = Path(path)
    stem = _stem(path)
    card, weights = _beside(stem, CARD), _beside(stem, WEIGHTS)
    for file in (path, card):
        # weights are not checked: the length of their header may begin like a pickle
        if file.suffix != WEIGHTS and (reason := foreign(file)):
            raise BadActor(file, "file", reason)
    if path.is_file() and path not in (card, weights):
        raise BadActor(path, "file", f"is no actor, which is NAME{CARD} beside NAME{WEIGHTS}")
    try:
        read = read_card(parsed(card, MAX_CARD_BYTES))
        network = Network(*_layers(weights, read), read.activation, read.output)
        return Actor(network=network, **read.actor)
    except Refused as error:
        raise BadActor(card, one_line(error.key), one_line(error.reason)) from None
    except BadActor:
        raise
    except OneDemoError as error:
        raise BadActor(card, "content", one_line(str(error))) from None


def card_path(path: Path) -> Path:
    """Return the path of an actor's .json, for any path that `load_actor` accepts."""
    return _beside(_stem(path), CARD)


def foreign(path: Path) -> str:
    """Return why a file often mistaken for an actor is refused; "" if it may be an actor, or does not exist."""
    try:
        if not path.is_file():
            return ""
        with path.open("rb") as file:
            begin = file.read(4)
    except OSError:
        return ""
    return next((reason for magic, reason in FOREIGN.items() if begin.startswith(magic)), "")


def _stem(path: Path) -> Path:
    if path.is_dir():
        return path / "actor"
    return path.with_suffix("") if path.suffix in (CARD, WEIGHTS) else path


def _beside(stem: Path, suffix: str) -> Path:
    return stem.with_name(stem.name + suffix)


def _names(layer: int) -> tuple[str, str]:
    return f"layers.{layer}.weight", f"layers.{layer}.bias"


def _layers(path: Path, card: Card) -> tuple[tuple[np.ndarray, ...], tuple[np.ndarray, ...]]:
    """Return weights and biases per layer, after checking size and digest of the file against the .json."""
    shapes, sizes = {}, card.sizes
    for k in range(len(sizes) - 1):
        shapes.update(zip(_names(k), ((sizes[k + 1], sizes[k]), (sizes[k + 1],)), strict=True))
    expected = 4 * sum(math.prod(shape) for shape in shapes.values())
    size = card.bytes
    if size > MAX_BYTES:
        raise Refused("weights.bytes", f"is {size}; at most {MAX_BYTES} are read")
    header = size - 8 - expected
    if not 0 < header <= MAX_HEADER_BYTES:
        raise Refused("weights.bytes", f"is {size}; layers of these sizes have {expected} and a header")
    data = _content(path, size)
    if hashlib.sha256(data).hexdigest() != card.sha256:
        raise BadActor(path, "file", "has another SHA-256 than the .json says: it is damaged, or of another actor")
    if int.from_bytes(data[:8], "little") != header:
        raise BadActor(path, "header", f"does not have {header} bytes")
    arrays = _tensors(path, data)
    for name in [*shapes, *arrays]:
        found = arrays[name].shape if name in arrays else None
        if found != shapes.get(name):
            raise BadActor(path, one_line(name), f"has shape {found}; expected {shapes.get(name)}")
        if not np.isfinite(arrays[name]).all():
            raise BadActor(path, name, "holds a value that is not finite")
    layers = [tuple(arrays[name] for name in _names(k)) for k in range(len(sizes) - 1)]
    return tuple(layer[0] for layer in layers), tuple(layer[1] for layer in layers)


def _content(path: Path, size: int) -> bytes:
    """Return the bytes of a file that must have the given size."""
    try:
        found = path.stat().st_size if path.is_file() else -1
        if found == size:
            return path.read_bytes()
    except OSError as error:
        raise BadActor(path, "file", f"cannot be read ({error.strerror})") from None
    reason = "does not exist" if found < 0 else f"has {found} bytes; the .json says {size}: it is cut, or another's"
    raise BadActor(path, "file", reason)


def _tensors(path: Path, data: bytes) -> dict[str, np.ndarray]:
    from safetensors import SafetensorError, deserialize

    arrays = {}
    try:
        for name, entry in deserialize(data):
            if entry["dtype"] != "F32":
                raise BadActor(path, one_line(name), f"is of {entry['dtype']}; expected F32")
            arrays[name] = np.frombuffer(entry["data"], dtype="<f4").reshape(entry["shape"])
    except (SafetensorError, ValueError, KeyError, TypeError, OverflowError) as error:
        if isinstance(error, BadActor):
            raise
        raise BadActor(path, "header", f"is not that of a safetensors file ({one_line(str(error))})") from None
    return arrays
