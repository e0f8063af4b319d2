"""Strict parsing of untrusted JSON: any deviation is refused, and the error names its key."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import numpy as np

from .errors import OneDemoError


class Refused(OneDemoError, ValueError):
    """An entry of a JSON file is invalid."""

    def __init__(self, key: str, reason: str):
        self.key, self.reason = key, reason
        super().__init__(f"{key}: {reason}")


def parsed(path: Path, max_bytes: int) -> Any:
    """Parse a JSON file (UTF-8); NaN, infinity and duplicate keys are refused.

    Args:
        path: of the file.
        max_bytes: largest accepted size of the file [bytes].

    Raises:
        Refused: the file is missing, too large or not valid JSON.
    """
    if not path.is_file():
        raise Refused("file", "does not exist")
    try:
        size = path.stat().st_size
        if size > max_bytes:
            raise Refused("file", f"holds {size} bytes; at most {max_bytes} are read")
        text = path.read_text(encoding="utf-8")
        return json.loads(text, parse_constant=_no_number, object_pairs_hook=_unique)
    except (Refused, RecursionError, ValueError, OSError) as error:
        if isinstance(error, Refused):
            raise
        reason = "too deeply nested" if isinstance(error, RecursionError) else str(error).splitlines()[0]
        raise Refused("file", f"is not readable JSON ({reason})") from None


def _no_number(text: str) -> None:
    raise Refused("file", f"holds {text}, which is no number")


def _unique(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    table = dict(pairs)
    for key, _ in pairs:
        if len(table) == len(pairs):
            break
        if sum(key == other for other, _ in pairs) > 1:
            raise Refused(key, "stands twice in one table")
    return table


def table_of(key: str, value: Any, expected: tuple[str, ...]) -> dict[str, Any]:
    """Check that a value is a table with exactly the expected keys.

    Args:
        key: of the value, for messages; "" for the whole file.
        value: the parsed value.
        expected: the keys.

    Raises:
        Refused: no table, a missing or an unknown key.
    """
    if not isinstance(value, dict):
        raise Refused(key or "file", "is not a table")
    for name in expected:
        if name not in value:
            raise Refused(f"{key}.{name}".lstrip("."), "is missing")
    for name in value:
        if name not in expected:
            raise Refused(f"{key}.{name}".lstrip("."), f"is unknown; allowed: {', '.join(expected)}")
    return value


def list_of(key: str, value: Any) -> list[Any]:
    """Check that a value is a list.

    Args:
        key: of the value, for messages.
        value: the parsed value.

    Raises:
        Refused: the value is not a list.
    """
    if not isinstance(value, list):
        raise Refused(key, "is not a list")
    return value


def text_of(key: str, value: Any) -> str:
    """Check that a value is a string.

    Args:
        key: of the value, for messages.
        value: the parsed value.

    Raises:
        Refused: the value is not a string.
    """
    if not isinstance(value, str):
        raise Refused(key, f"is a {type(value).__name__}, not a text")
    return value


def texts_of(key: str, value: Any) -> tuple[str, ...]:
    """Check that a value is a list of strings.

    Args:
        key: of the value, for messages.
        value: the parsed value.

    Raises:
        Refused: the value is not a list of strings.
    """
    return tuple(text_of(f"{key}[{k}]", item) for k, item in enumerate(list_of(key, value)))


def number_of(key: str, value: Any) -> float:
    """Check that a value is a finite number and return it as float.

    Args:
        key: of the value, for messages.
        value: the parsed value; true and false are refused.

    Raises:
        Refused: the value is not a finite number.
    """
    if isinstance(value, bool) or not isinstance(value, int | float | np.integer | np.floating):
        raise Refused(key, f"is a {type(value).__name__}, not a number")
    try:
        number = float(value)
    except OverflowError:
        number = math.inf
    if not math.isfinite(number):
        raise Refused(key, f"is {number}, which is not finite")
    return number


def numbers_of(key: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """Convert nested lists of finite numbers to a float64 array.

    Args:
        key: of the value, for messages.
        value: the lists.
        shape: required shape; None stands for any length.

    Raises:
        Refused: another shape, or an entry that is not a finite number.
    """
    array = np.array(_nested(key, value, shape), dtype=np.float64)
    return array if array.size else array.reshape([size or 0 for size in shape])


def _nested(key: str, value: Any, shape: tuple[int | None, ...]) -> Any:
    if not shape:
        return number_of(key, value)
    items = list_of(key, value)
    if shape[0] is not None and len(items) != shape[0]:
        raise Refused(key, f"has {len(items)} entries; expected {shape[0]}")
    return [_nested(f"{key}[{k}]", item, shape[1:]) for k, item in enumerate(items)]
