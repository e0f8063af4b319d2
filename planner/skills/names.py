"""Names of a demonstration and of a scene: the same thing is often written in two ways."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping

from ..errors import UnknownName

ENDINGS = re.compile(r"(_main|_body|_root|_base|_object|_obj|_jo?i?nt\d*|\d+)+$", re.IGNORECASE)
"""What simulators append to the name of a thing."""


def plain(name: str) -> str:
    """Return a name without what simulators append to it, in small letters and without underscores."""
    return (ENDINGS.sub("", name) or name).replace("_", "").lower()


def matched_names(shown: Iterable[str], known: Iterable[str], given: Mapping[str, str] | None = None) -> dict[str, str]:
    """Return the name in a scene of each thing that a demonstration names.

    Args:
        shown: names of the demonstration.
        known: names of the scene.
        given: pairs that a user gives; they go before what is found.

    Raises:
        UnknownName: a name, or a given one, has no counterpart.
    """
    allowed, given = list(known), dict(given or {})
    for name in given.values():
        if name not in allowed:
            raise UnknownName("thing of the task", name, allowed)
    found = {}
    for name in shown:
        options = [given[name]] if name in given else _options(name, allowed)
        if not options:
            raise UnknownName("thing of the task, as the demonstration names it,", name, allowed)
        found[name] = options[0]
    return found


def _options(name: str, known: list[str]) -> list[str]:
    """Return the names that may mean the same thing: the same letters, else the same without endings."""
    if name in known:
        return [name]
    same = [other for other in known if other.lower() == name.lower()]
    return same or [other for other in known if plain(other) == plain(name)]
