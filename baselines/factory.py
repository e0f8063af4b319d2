"""Policies by name, their settings checked strictly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields, is_dataclass
from typing import Any, TypeVar, get_type_hints

from pydantic import TypeAdapter, ValidationError

from ..envs.task import TaskDescription
from ..planner.demo import Demonstration
from ..planner.errors import BadConfig, OneDemoError, UnknownName
from .policy import Policy
from .screw_policy import ScrewPolicy, ScrewSettings

Settings = TypeVar("Settings")


@dataclass(frozen=True, slots=True)
class PolicyKind:
    """A policy that a config may name: its settings' dataclass and its constructor."""

    settings: type
    make: Callable[[TaskDescription, Demonstration, Any], Policy]


POLICIES = {"screw": PolicyKind(ScrewSettings, ScrewPolicy)}


def make_policy(
    name: str, task: TaskDescription, demonstration: Demonstration, settings: Mapping[str, Any] | None = None
) -> Policy:
    """A policy for a task.

    Args:
        name: one of `POLICIES`.
        task: `env.unwrapped.task`.
        demonstration: the ONE demonstration.
        settings: the policy's settings as nested mappings; what is missing keeps its default.

    Raises:
        UnknownName: no such policy.
        BadConfig: an unknown key, a wrong type, a value out of range.
    """
    if name not in POLICIES:
        raise UnknownName("policy", name, POLICIES)
    kind = POLICIES[name]
    return kind.make(task, demonstration, settings_from(kind.settings, settings or {}, f"settings of {name!r}"))


def settings_from(kind: type[Settings], values: Mapping[str, Any], source: str) -> Settings:
    """A settings dataclass, nested ones included, from mappings as YAML gives them."""
    try:
        return TypeAdapter(kind).validate_python(dict(values), strict=False)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        if first["type"] == "unexpected_keyword_argument":
            raise BadConfig(source, key, f"unknown key; allowed: {', '.join(_allowed(kind, first['loc']))}") from None
        raise BadConfig(source, key, first["msg"]) from None
    except OneDemoError as error:
        raise BadConfig(source, "", str(error)) from None


def _allowed(kind: type, location: tuple[str | int, ...]) -> list[str]:
    for part in location[:-1]:
        kind = get_type_hints(kind)[str(part)]
    return [field.name for field in fields(kind)] if is_dataclass(kind) else []
