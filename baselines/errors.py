"""Errors of policies: actors that cannot act, libraries that are missing."""

from __future__ import annotations

from pathlib import Path

from ..planner.errors import OneDemoError


class BadActor(OneDemoError, ValueError):
    """A learned policy's file cannot be used, or is of another method, task, robot or control."""

    def __init__(self, path: str | Path, key: str, reason: str):
        self.path, self.key, self.reason = path, key, reason
        super().__init__(f"{path}: {key}: {reason}")


class MissingExtra(OneDemoError, ImportError):
    """An optional library is not installed."""

    def __init__(self, library: str, extra: str, detail: str):
        self.library, self.extra, self.detail = library, extra, detail
        super().__init__(f"{library} is needed ({detail}): pip install 'onedemo[{extra}]'")
