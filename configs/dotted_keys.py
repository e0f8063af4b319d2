"""Nested mappings by keys with dots: `settings.motion.guide`."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

MISSING: Any = object()


def at(values: Mapping[str, Any], key: str) -> Any:
    """The value at a key with dots; MISSING if there is none."""
    here: Any = values
    for part in key.split("."):
        if not isinstance(here, Mapping) or part not in here:
            return MISSING
        here = here[part]
    return here


def having(values: Mapping[str, Any], key: str, value: Any) -> dict[str, Any]:
    """The mapping with a value at a key with dots; what stands in the way is replaced."""
    first, _, rest = key.partition(".")
    inside = values.get(first)
    if rest:
        value = having(inside if isinstance(inside, Mapping) else {}, rest, value)
    return {**values, first: value}


def without(values: Mapping[str, Any], key: str) -> dict[str, Any]:
    """The mapping without a key with dots, and without mappings that this leaves empty."""
    first, _, rest = key.partition(".")
    result = dict(values)
    inside = result.pop(first, None)
    if rest and isinstance(inside, Mapping) and (left := without(inside, rest)):
        result[first] = left
    return result


def merged(weak: Mapping[str, Any], strong: Mapping[str, Any]) -> dict[str, Any]:
    """Both, mappings merged; where they disagree, the strong one."""
    result = dict(weak)
    for key, value in strong.items():
        before: Any = result.get(key)
        both = isinstance(before, Mapping) and isinstance(value, Mapping)
        result[key] = merged(before, value) if both else value
    return result


def leaves(values: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Keys with dots and values of all that is not a mapping with something in it."""
    for key, value in values.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, f"{prefix}{key}.")
        else:
            yield f"{prefix}{key}", value
