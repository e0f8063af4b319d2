"""Errors of configuration files."""

from __future__ import annotations

from pathlib import Path

from ..planner.errors import OneDemoError


class BadConfig(OneDemoError, ValueError):
    """A configuration file or an override on the command line cannot be used."""

    def __init__(self, source: str | Path, key: str, reason: str):
        self.source, self.key, self.reason = source, key, reason
        super().__init__(f"{source}: {key}: {reason}" if key else f"{source}: {reason}")
