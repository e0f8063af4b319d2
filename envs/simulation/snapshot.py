"""Snapshots of a simulation as plain arrays, without its compiled model, which is too large for a pickle."""

from __future__ import annotations

from collections.abc import Iterator
from operator import attrgetter
from typing import Any, NamedTuple

import numpy as np

from ..mujoco_library import mujoco

SHOWN = "bvh_active"
"""The one large array of MuJoCo's data: what its viewer may highlight."""
STRUCTS = mujoco.MjModel.__module__


class Snapshot(NamedTuple):
    """State of a model and its data at a moment.

    Attributes:
        time: simulated time [s].
        data: arrays of the data by name: state, warm starts, and what the last step has derived from the state before.
        changed: numbers of the model that differ from the compiled one's: by name, where in the flat array they
            stand, and what they are. Those of obstacles differ, and what a user has changed.
    """

    time: float
    data: dict[str, np.ndarray]
    changed: dict[str, tuple[np.ndarray, np.ndarray]]


def taken(compiled: mujoco.MjModel, model: mujoco.MjModel, data: mujoco.MjData) -> Snapshot:
    """Return the state of a model and its data.

    Args:
        compiled: model of the scene, unchanged.
        model: copy of this model.
        data: data of the copy.
    """
    # what fresh data have none of, contacts and constraints, lies where a step puts it
    fresh = dict(_members(mujoco.MjData(model)))
    names = [name for name, value in fresh.items() if isinstance(value, np.ndarray) and value.size and name != SHOWN]
    arrays = {name: np.array(getattr(data, name)) for name in names}
    known = dict(_entries(compiled))
    changed = {}
    for name, value in _entries(model):
        now, before = np.ravel(value), np.ravel(known[name])
        # arrays of bounding volumes are large, and few of them are of obstacles
        where = np.flatnonzero(now != before)
        if len(where):
            changed[name] = where, now[where]
    return Snapshot(data.time, arrays, changed)


def put(snapshot: Snapshot, model: mujoco.MjModel, data: mujoco.MjData) -> None:
    """Put a state into a fresh copy of the compiled model, and into its fresh data.

    Args:
        snapshot: state, taken of another copy.
        model: copy of the compiled model.
        data: data of this copy.
    """
    for name, (where, values) in snapshot.changed.items():
        owner, _, last = name.rpartition(".")
        struct = attrgetter(owner)(model) if owner else model
        changed = np.array(getattr(struct, last))
        changed.flat[where] = values
        _assign(struct, last, changed)
    for name, value in snapshot.data.items():
        _assign(data, name, value)
    data.time = snapshot.time
    # contacts are those of the last step's frames, which are older than the positions
    mujoco.mj_collision(model, data)


def _entries(struct: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the numbers and arrays of a MuJoCo struct, and of the structs in it, with their dotted names."""
    for name, value in _members(struct):
        if isinstance(value, np.ndarray | int | float):
            yield prefix + name, value
        elif type(value).__module__ == STRUCTS:  # options, statistics, and what is shown how
            yield from _entries(value, f"{prefix}{name}.")


def _members(struct: Any) -> Iterator[tuple[str, Any]]:
    return ((name, getattr(struct, name)) for name in dir(struct) if not name.startswith("_"))


def _assign(struct: Any, name: str, value: np.ndarray) -> None:
    if value.ndim:
        getattr(struct, name)[...] = value
    else:
        setattr(struct, name, value.item())
