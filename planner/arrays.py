"""Checks of what callers hand in: arrays for the kernels, and the kinds of other arguments.

A kernel does not check its indices, so an array of a wrong shape would read or damage other memory. Every public
function that hands an array to a kernel therefore takes it through `checked_array`, which also gives the kernels one
kind of array, whatever the caller has: others would be compiled for anew.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import fields
from os import PathLike
from pathlib import Path
from typing import Any, TypeGuard, TypeVar

import numpy as np

from .errors import BadOption, BadShape, NotFinite, WrongType

Item = TypeVar("Item")
Sizes = tuple[int | None, ...]
FLOAT64 = np.dtype(np.float64)
NUMBERS = "biuf"
"""Kinds of numpy arrays that hold real numbers."""


def numbers(what: str, value: Any) -> np.ndarray:
    """Return real numbers as a float64 array of any shape, an array of float64 as it is.

    Args:
        what: name of the value, for messages.
        value: an array, or nested sequences.

    Raises:
        WrongType: anything else than real numbers in a rectangular array, or some are masked.
    """
    if type(value) is np.ndarray and value.dtype == np.float64:
        return value
    if np.ma.is_masked(value):  # numpy would hand out what lies under the mask
        raise WrongType(what, value, "an array of numbers, none of them masked")
    try:
        array = np.asarray(value)
    except (TypeError, ValueError):
        raise WrongType(what, value, "an array of numbers") from None
    if array.dtype.kind not in NUMBERS:
        raise WrongType(what, value, "an array of numbers")
    return array.astype(np.float64)


def is_fit(value: Any, shape: tuple[int, ...]) -> TypeGuard[np.ndarray]:
    """Return whether a value certainly is what `checked_array` returns as it is; quick, for what happens at every tick.

    Args:
        value: the value.
        shape: required shape, of one axis.
    """
    if type(value) is not np.ndarray or value.shape != shape or value.dtype is not FLOAT64 or not value.flags.carray:
        return False
    total = sum(value.tolist())  # of a few numbers quicker than numpy's functions
    return total - total == 0.0  # not so for NaN and infinity


def checked_array(what: str, value: Any, shape: Sizes, *, finite: bool = True) -> np.ndarray:
    """Return numbers as a kernel takes them: float64, C-contiguous, aligned and writable.

    Args:
        what: name of the value, for messages.
        value: an array, or nested sequences.
        shape: required shape; None stands for any length.
        finite: False: NaN and infinity are allowed.

    Returns:
        The given array itself if it is fit, else a copy.

    Raises:
        WrongType, BadShape, NotFinite: anything else than real numbers, another shape, or NaN or infinity.
    """
    array = numbers(what, value)
    if array.shape != shape and not _fits(array.shape, shape):
        raise BadShape(what, array.shape, _words(shape))
    if finite and not np.isfinite(array).all():
        place = tuple(int(k) for k in np.argwhere(~np.isfinite(array))[0])
        raise NotFinite(what, place[0] if len(place) == 1 else place)
    return array if array.flags.carray else np.array(array, order="C")


def frozen(array: np.ndarray) -> np.ndarray:
    """Return a read-only, C-contiguous copy of an array of float64."""
    out = np.array(array, dtype=np.float64, order="C")
    out.flags.writeable = False
    return out


def broadcast_shape(what: str, *shapes: tuple[int, ...]) -> tuple[int, ...]:
    """Return the common shape of arrays.

    Args:
        what: names of the arrays, for messages.
        *shapes: their shapes, without the columns.

    Raises:
        BadShape: the shapes do not fit together.
    """
    try:
        return np.broadcast_shapes(*shapes)
    except ValueError:
        raise BadShape(what, max(shapes, key=len), f"a shape that fits {shapes[0]}") from None


def checked_kind(what: str, value: Any, kind: type[Item]) -> Item:
    """Return a value of the required class.

    Args:
        what: name of the value, for messages.
        value: the value.
        kind: the class.

    Raises:
        WrongType: the value is of another class.
    """
    if not isinstance(value, kind):
        raise WrongType(what, value, f"{'an' if kind.__name__[0] in 'AEIO' else 'a'} {kind.__name__}")
    return value


def checked_settings(kind: type[Item], value: Item | None, what: str = "settings") -> Item:
    """Return settings of the required class; the default ones for None.

    Args:
        kind: the class.
        value: the settings.
        what: their name, for messages.

    Raises:
        WrongType: the settings are of another class.
    """
    return kind() if value is None else checked_kind(what, value, kind)


def checked_file(value: Any) -> Path:
    """Return the path of a file.

    Raises:
        WrongType: the value is neither a text nor a path.
    """
    if not isinstance(value, str | PathLike):
        raise WrongType("path", value, "the path of a file")
    return Path(value)


def checked_items(what: str, values: Iterable[Item], kind: type[Item]) -> tuple[Item, ...]:
    """Return items of the required class as a tuple, a tuple as it is.

    Args:
        what: name of the sequence, for messages.
        values: the items.
        kind: their class.

    Raises:
        WrongType: no sequence, or an item of another class.
    """
    if isinstance(values, str | bytes) or not isinstance(values, Iterable):
        raise WrongType(what, values, f"a sequence of {kind.__name__}")
    items = tuple(values)
    for k, item in enumerate(items):
        if not isinstance(item, kind):
            checked_kind(f"{what}[{k}]", item, kind)
    return items


def check_capacity(what: str, count: int, most: int) -> None:
    """Refuse more things than there is room for.

    Args:
        what: name of the things, for messages.
        count: their number.
        most: the largest number allowed.

    Raises:
        BadOption: there are more.
    """
    if count > most:
        raise BadOption(what, f"there are {count}; allowed are {most}")


def _fits(shape: tuple[int, ...], wanted: Sizes) -> bool:
    return len(shape) == len(wanted) and all(size in (None, n) for size, n in zip(wanted, shape, strict=True))


def _words(shape: Sizes) -> str:
    sizes = ["n" if size is None else str(size) for size in shape]
    return f"({', '.join(sizes)}{',' * (len(sizes) == 1)})"


class FrozenArrays:
    """Base of frozen dataclasses with read-only arrays: these stay so in pickles, and a copy is the value itself.

    Writable ones could be changed behind the back of all who share them, and kernels would be compiled anew for them.
    """

    __slots__ = ()

    def __copy__(self: Item) -> Item:
        return self

    def __deepcopy__(self: Item, memo: object) -> Item:
        return self

    def __reduce__(self) -> tuple[Any, ...]:
        """Pickle the values as they are: checking them anew could change their last bits."""
        kind: Any = type(self)
        return _unpickled, (kind, tuple(getattr(self, each.name) for each in fields(kind)))


def _unpickled(kind: Any, values: tuple[Any, ...]) -> Any:
    made = object.__new__(kind)
    for each, value in zip(fields(kind), values, strict=True):
        _freeze(value)
        object.__setattr__(made, each.name, value)
    return made


def _freeze(value: Any) -> None:
    if isinstance(value, np.ndarray):
        value.flags.writeable = False
    elif isinstance(value, tuple):
        for item in value:
            _freeze(item)
    elif isinstance(value, Mapping):
        _freeze(tuple(value.values()))
