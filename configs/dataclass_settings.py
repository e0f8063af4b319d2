"""Settings dataclasses read from YAML: unknown keys are refused, every value is checked."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from ..planner.errors import OneDemoError
from .errors import BadConfig

Settings = TypeVar("Settings")


def settings_from(kind: type[Settings], values: Mapping[str, Any], source: str) -> Settings:
    """Read a settings dataclass, including nested ones, from mappings as parsed from YAML.

    A field's former key (`metadata["formerly"]`) is accepted for the field.

    Args:
        kind: dataclass to read.
        values: values by field; missing fields have their defaults.
        source: name of the file, for messages.

    Raises:
        BadConfig: an unknown key, a field given by both of its names, or a value that the field refuses.
    """
    values = _with_new_names(kind, values, source, "")
    _refuse_unknown(kind, values, source, "")
    try:
        return _adapter(kind).validate_python(dict(values), strict=False)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise BadConfig(source, key, f"{first['msg']}, got {first['input']!r}") from None
    except OneDemoError as error:
        raise BadConfig(source, "", str(error)) from None


@cache
def _adapter(kind: type) -> TypeAdapter:
    """Return pydantic's adapter of a dataclass, cached: building it takes longer than planning many a path."""
    return TypeAdapter(kind)


def _class_of(kind: Any) -> Any:
    """Return the dataclass of a type, also of an optional one."""
    return next((part for part in get_args(kind) if is_dataclass(part)), kind)


def _with_new_names(kind: Any, values: Any, source: str, prefix: str) -> Any:
    """Return the values under the present names of the fields."""
    kind = _class_of(kind)
    if not (is_dataclass(kind) and isinstance(values, Mapping)):
        return values
    former = {field.metadata["formerly"]: field for field in fields(kind) if "formerly" in field.metadata}
    types, found = get_type_hints(kind), {}
    for key, value in values.items():
        field = former.get(key)
        name = field.name if field else key
        if field and name in values:
            raise BadConfig(source, f"{prefix}{key}", f"is the former name of {name}: write one of them")
        if field and isinstance(value, str):
            value = field.metadata.get("values", {}).get(value, value)
        found[name] = _with_new_names(types.get(name), value, source, f"{prefix}{key}.")
    return found


def _refuse_unknown(kind: Any, values: Any, source: str, prefix: str) -> None:
    """Refuse keys without a field: pydantic's validation of dataclasses ignores them."""
    kind = _class_of(kind)
    if not (is_dataclass(kind) and isinstance(values, Mapping)):
        return
    allowed, types = [field.name for field in fields(kind)], get_type_hints(kind)
    for key, value in values.items():
        if key not in allowed:
            raise BadConfig(source, f"{prefix}{key}", f"unknown key; allowed: {', '.join(allowed)}")
        _refuse_unknown(types[key], value, source, f"{prefix}{key}.")
