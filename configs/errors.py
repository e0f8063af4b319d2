"""Errors of configuration files."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches
from pathlib import Path

from ..planner.errors import OneDemoError


class BadConfig(OneDemoError, ValueError):
    """A configuration file or an override on the command line cannot be used."""

    def __init__(self, source: str | Path, key: str, reason: str):
        self.source, self.key, self.reason = source, key, reason
        super().__init__(f"{source}: {key}: {reason}" if key else f"{source}: {reason}")


def unknown_key(key: str, allowed: Iterable[str], elsewhere: Iterable[str] = ()) -> str:
    """Return the message that refuses a key, with the key that may have been meant.

    Args:
        key: refused key.
        allowed: allowed keys.
        elsewhere: dotted keys in other places, one of which may end in this key.
    """
    known = tuple(allowed)
    close = [dotted for dotted in elsewhere if dotted.rpartition(".")[2] == key] or get_close_matches(key, known, n=1)
    hint = f"did you mean {close[0]!r}? " if close else ""
    return f"unknown key; {hint}allowed: {', '.join(known) or 'none'}"
