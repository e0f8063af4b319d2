"""Errors of environments: unusable tasks and actions, obstacles that do not fit, unavailable rendering."""

from __future__ import annotations

from ..planner.errors import BadOption, OneDemoError

INSTALL = "install one of: apt install libegl1 libegl-mesa0 libgl1-mesa-dri, or apt install libosmesa6"


class NoRoom(BadOption):
    """None of the drawn starts has enough clearance for the obstacles."""

    def __init__(self, kind: object):
        self.kind = kind
        super().__init__("obstacles", f"no room for {kind!r} obstacles beside this start")


class BadTask(OneDemoError, ValueError):
    """A user's own task cannot be used."""

    def __init__(self, name: object, key: str, reason: str):
        self.name, self.key, self.reason = name, key, reason
        super().__init__(f"task {name!r}: {key}: {reason}" if key else f"task {name!r}: {reason}")


class BadAction(OneDemoError, ValueError):
    """An action has the wrong shape or is not finite."""

    def __init__(self, reason: str):
        self.reason = reason
        super().__init__(f"action: {reason}")


class RenderingUnavailable(OneDemoError, RuntimeError):
    """No OpenGL library can draw without a display, or not in this process."""

    def __init__(self, detail: str, remedy: str = INSTALL):
        self.detail, self.remedy = detail, remedy
        super().__init__(f"no picture can be drawn ({detail}); {remedy}")
