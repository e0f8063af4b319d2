"""Settings dataclasses read from YAML: unknown keys are refused, every value is checked."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from typing import Any, TypeVar, get_args, get_type_hints

from pydantic import TypeAdapter, ValidationError

from ..planner.errors import BadOption, OneDemoError
from .errors import BadConfig, unknown_key

Settings = TypeVar("Settings")


def settings_from(kind: type[Settings], values: Mapping[str, Any], source: str) -> Settings:
    """Read a settings dataclass, including nested ones, from mappings as parsed from YAML.

    Former keys are accepted, see `with_present_names`.

    Args:
        kind: dataclass to read.
        values: values by field; missing fields have their defaults.
        source: name of the file, for messages.

    Raises:
        BadConfig: an unknown key, a field given by both of its names, or a value that the field refuses.
    """
    values = with_present_names(kind, values, source)
    _refuse_unknown(kind, kind, values, source, "")
    try:
        return _adapter(kind).validate_python(dict(values), strict=False)
    except ValidationError as error:
        first = error.errors()[0]
        cause, parts = first.get("ctx", {}).get("error"), [str(part) for part in first["loc"]]
        if isinstance(cause, BadOption):  # of a dataclass, which names the field itself
            raise BadConfig(source, ".".join([*parts, cause.option]), cause.reason) from None
        reason = str(cause) if cause else f"{first['msg'][0].lower()}{first['msg'][1:]}, got {first['input']!r}"
        raise BadConfig(source, ".".join(parts), reason) from None
    except BadOption as error:
        raise BadConfig(source, error.option, error.reason) from None
    except OneDemoError as error:
        raise BadConfig(source, "", str(error)) from None


@cache
def _adapter(kind: type) -> TypeAdapter:
    """Return pydantic's adapter of a dataclass, cached: building it takes longer than planning many a path."""
    return TypeAdapter(kind)


def _class_of(kind: Any) -> Any:
    """Return the dataclass of a type, also of an optional one."""
    return next((part for part in get_args(kind) if is_dataclass(part)), kind)


def with_present_names(kind: Any, values: Any, source: str, prefix: str = "") -> Any:
    """Return nested mappings with the present names of all fields.

    A field's former key is its `metadata["formerly"]`; `metadata["values"]` are present values by former ones. A former
    key of several fields is a switch that sets all of them.

    Args:
        kind: settings dataclass, or the type of any value.
        values: values by field; what is no mapping, or not of a dataclass, is returned as it is.
        source: name of the file, for messages.
        prefix: dotted key of the mapping, with a dot at its end.

    Raises:
        BadConfig: a field is given by both of its names, or a switch is neither true nor false.
    """
    kind = _class_of(kind)
    if not (is_dataclass(kind) and isinstance(values, Mapping)):
        return values
    types, found = get_type_hints(kind), {}
    for key, value in values.items():
        renamed = [field for field in fields(kind) if field.metadata.get("formerly") == key]
        if len(renamed) > 1 and not isinstance(value, bool):
            now = " and ".join(field.name for field in renamed)
            raise BadConfig(source, f"{prefix}{key}", f"is neither true nor false, got {value!r}; now it is {now}")
        for field in renamed:
            if field.name in values:
                raise BadConfig(source, f"{prefix}{key}", f"is the former name of {field.name}: write one of them")
            other = field.metadata.get("values", {}) if isinstance(value, str | bool) else {}
            found[field.name] = with_present_names(
                types[field.name], other.get(value, value), source, f"{prefix}{key}."
            )
        if not renamed:
            found[key] = with_present_names(types.get(key), value, source, f"{prefix}{key}.")
    return found


def _dotted(kind: Any, prefix: str = "") -> Iterator[str]:
    """Yield the dotted names of all fields of a settings dataclass, those of nested ones included."""
    types = get_type_hints(kind)
    for field in fields(kind):
        yield prefix + field.name
        inner = _class_of(types[field.name])
        if is_dataclass(inner):
            yield from _dotted(inner, f"{prefix}{field.name}.")


def _refuse_unknown(root: type, kind: Any, values: Any, source: str, prefix: str) -> None:
    """Refuse keys without a field: pydantic's validation of dataclasses ignores them."""
    kind = _class_of(kind)
    if not (is_dataclass(kind) and isinstance(values, Mapping)):
        return
    allowed, types = [field.name for field in fields(kind)], get_type_hints(kind)
    for key, value in values.items():
        if key not in allowed:
            raise BadConfig(source, f"{prefix}{key}", unknown_key(str(key), allowed, _dotted(root)))
        _refuse_unknown(root, types[key], value, source, f"{prefix}{key}.")
