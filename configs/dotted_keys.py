"""Access to nested mappings by dotted keys: `settings.motion.guide`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

MISSING: Any = object()


def at(values: Mapping[str, Any], key: str) -> Any:
    """Return the value at a dotted key; MISSING if there is none.

    Args:
        values: nested mapping.
        key: dotted key.
    """
    here: Any = values
    for part in key.split("."):
        if not isinstance(here, Mapping) or part not in here:
            return MISSING
        here = here[part]
    return here


def having(values: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """Return the mapping with a value at a dotted key; a value in the place of an inner mapping is replaced.

    Args:
        values: nested mapping.
        key: dotted key.
        value: value to set.
    """
    first, _, rest = key.partition(".")
    inside = values.get(first)
    if rest:
        value = having(inside if isinstance(inside, Mapping) else {}, rest, value)
    return {**values, first: value}


def without(values: Mapping[str, Any], key: str) -> dict[str, Any]:
    """Return the mapping without a dotted key, and without mappings that become empty.

    Args:
        values: nested mapping.
        key: dotted key.
    """
    first, _, rest = key.partition(".")
    result = dict(values)
    inside = result.pop(first, None)
    if rest and isinstance(inside, Mapping) and (left := without(inside, rest)):
        result[first] = left
    return result


def merged(weak: Mapping[str, Any], strong: Mapping[str, Any]) -> dict[str, Any]:
    """Return both mappings merged, nested ones included.

    Args:
        weak: nested mapping.
        strong: nested mapping whose values win where they conflict.
    """
    result = dict(weak)
    for key, value in strong.items():
        before: Any = result.get(key)
        both = isinstance(before, Mapping) and isinstance(value, Mapping)
        result[key] = merged(before, value) if both else value
    return result


def leaves(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Yield dotted key and value of everything except non-empty mappings.

    Args:
        values: nested mapping.
        prefix: text before every key.
    """
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
