"""Complete state of a learner in files that hold no code: weights, optimizers, replay buffer."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig
from .evaluations import NUMBERS

WEIGHTS, REPLAY = "weights.safetensors", "replay.npz"
COUNTS = ("num_timesteps", "_n_updates", "_episode_num")
"""Counters of a model that are part of its state."""
BUFFERED = ("observations", "next_observations", "actions", "rewards", "dones", "timeouts", "ep_start", "ep_length")
"""Arrays of a replay buffer that are stored if it has them."""
PLACES = ("pos", "full", "_current_ep_start")
"""Positions within a replay buffer that are stored if it has them."""


def save_state(model: Any, folder: Path, more: dict[str, Any]) -> None:
    """Write the state of a model into a folder.

    Args:
        model: model of Stable-Baselines3, or a `Clone`.
        folder: existing folder.
        more: further JSON values to store with the state.
    """
    from safetensors.torch import save_file

    tensors: dict[str, Any] = {}
    tables = {name: _taken_apart(part, name, tensors) for name, part in parts_of(model)}
    save_file({key: tensor.detach().cpu().contiguous().clone() for key, tensor in tensors.items()}, folder / WEIGHTS)
    numbers = {"tables": tables, "counts": {key: getattr(model, key) for key in COUNTS if hasattr(model, key)}, **more}
    buffer = getattr(model, "replay_buffer", None)
    if buffer is not None:
        np.savez(folder / REPLAY, **dict(_buffered(buffer)))
    (folder / NUMBERS).write_text(json.dumps(numbers), encoding="utf-8")


def load_state(model: Any, folder: Path) -> dict[str, Any]:
    """Restore the state in a folder into a model that was made from the same config.

    Args:
        model: see `save_state`.
        folder: folder written by `save_state`.

    Returns:
        All stored JSON values, `more` of `save_state` included.

    Raises:
        BadConfig: the files are damaged, or belong to another model.
    """
    from safetensors import SafetensorError
    from safetensors.torch import load_file

    try:
        numbers = json.loads((folder / NUMBERS).read_text(encoding="utf-8"))
        tensors = load_file(folder / WEIGHTS)
        for name, part in parts_of(model):
            part_state = _put_together(numbers["tables"][name], tensors)
            if hasattr(part, "load_state_dict"):
                part.load_state_dict(part_state)
            else:
                part.data.copy_(part_state)
        for key, value in numbers["counts"].items():
            setattr(model, key, value)
        if getattr(model, "replay_buffer", None) is not None:
            _refill(model.replay_buffer, folder / REPLAY)
    except (OSError, ValueError, KeyError, RuntimeError, SafetensorError, TypeError) as error:
        reason = f"cannot be used: {str(error).splitlines()[0] if str(error) else type(error).__name__}"
        raise BadConfig(folder, "", f"{reason}; remove this folder to begin this seed anew") from None
    return numbers


def parts_of(model: Any) -> Iterator[tuple[str, Any]]:
    """Yield name and object of everything in a model that is learned."""
    if hasattr(model, "_get_torch_save_params"):
        modules, tensors = model._get_torch_save_params()
        for name in (*modules, *tensors):
            part = model
            for step in name.split("."):
                part = getattr(part, step)
            if part is not None:
                yield name, part
    else:
        yield from model.parts()


def _taken_apart(part: Any, name: str, tensors: dict[str, Any]) -> Any:
    """Return a state as JSON values, with each tensor moved to `tensors` and replaced by its name."""
    state = part.state_dict() if hasattr(part, "state_dict") else part
    return _walked(state, name, tensors)


def _walked(value: Any, name: str, tensors: dict[str, Any]) -> Any:
    if hasattr(value, "detach"):
        tensors[name] = value
        return {"tensor": name}
    if isinstance(value, dict):
        items = [[key, _walked(each, f"{name}/{key}", tensors)] for key, each in value.items()]
        return {"items": items}
    if isinstance(value, list | tuple):
        return {"list": [_walked(each, f"{name}/{k}", tensors) for k, each in enumerate(value)]}
    return {"value": value}


def _put_together(table: dict[str, Any], tensors: dict[str, Any]) -> Any:
    if "tensor" in table:
        return tensors[table["tensor"]]
    if "items" in table:
        return {key: _put_together(each, tensors) for key, each in table["items"]}
    if "list" in table:
        return [_put_together(each, tensors) for each in table["list"]]
    return table["value"]


def _buffered(buffer: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the filled part of a buffer's arrays; arrays in dictionaries are named NAME/KEY."""
    count = buffer.buffer_size if buffer.full else buffer.pos
    for name in BUFFERED:
        value = getattr(buffer, name, None)
        if isinstance(value, dict):
            yield from ((f"{name}/{key}", array[:count]) for key, array in value.items())
        elif value is not None:
            yield name, value[:count]
    for name in PLACES:
        if hasattr(buffer, name):
            yield name, np.asarray(getattr(buffer, name))


def _refill(buffer: Any, file: Path) -> None:
    with np.load(file, allow_pickle=False) as arrays:
        for name in arrays.files:
            key, _, entry = name.partition("/")
            target = getattr(buffer, key)
            if key in PLACES:
                value = arrays[name]
                setattr(buffer, key, value.item() if value.ndim == 0 else value.copy())
            else:
                (target[entry] if entry else target)[: len(arrays[name])] = arrays[name]
