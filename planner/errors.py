"""Errors of the planner, and the root of all errors: one line for the reader, the offending data for the caller.

Other packages have errors of their own below the same root: `configs.errors`, `envs.errors`, `baselines.errors`.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any

MOST_DIGITS = 20
"""Digits behind the point by which any two lengths or angles that differ look different."""


def _allowed(names: Iterable[Any]) -> str:
    """Name what is allowed, for the end of a message."""
    return ", ".join(str(name) for name in names)


def told_apart(one: float, other: float, digits: int) -> tuple[str, str]:
    """Write two numbers for a message, with as many digits as it takes to tell them apart.

    Args:
        one: a number.
        other: another number.
        digits: least number of digits behind the point.
    """
    while f"{one:.{digits}f}" == f"{other:.{digits}f}" and digits < MOST_DIGITS:
        digits += 1
    return f"{one:.{digits}f}", f"{other:.{digits}f}"


def _described(value: Any) -> str:
    """Describe a value in few words: its class, and itself if it is short."""
    kind, text = type(value).__name__, repr(value)
    if value is None:
        return text
    return f"{text}, a {kind}" if len(text) <= 40 and "\n" not in text else f"a {kind}"


class _Raisable(type):
    """Kind of errors with `type(error)(error)` the error itself: so Gymnasium raises those of worker processes."""

    def __call__(cls, *args: Any, **named: Any) -> Any:
        if len(args) == 1 and type(args[0]) is cls and not named:
            return args[0]
        return super().__call__(*args, **named)


class OneDemoError(Exception, metaclass=_Raisable):
    """Root of all errors that a caller may want to catch; its text is one clear line."""

    def __reduce__(self) -> tuple[Any, ...]:
        """Return what makes the same error in another process, whatever its constructor takes."""
        return _unpickled, (type(self), self.args, self.__dict__)


def _unpickled(kind: type[OneDemoError], args: tuple[Any, ...], data: dict[str, Any]) -> OneDemoError:
    error = kind.__new__(kind, *args)
    vars(error).update(data)
    return error


class NotUnit(OneDemoError, ValueError):
    """A quaternion or dual quaternion is not of unit norm."""

    def __init__(self, what: str, norm: float):
        self.what, self.norm = what, norm
        super().__init__(f"{what} has norm {norm:.9g}; expected 1 (normalize it first)")


class BadShape(OneDemoError, ValueError):
    """An array has the wrong shape."""

    def __init__(self, what: str, shape: tuple[int, ...], expected: str):
        self.what, self.shape, self.expected = what, shape, expected
        super().__init__(f"{what} has shape {shape}; expected {expected}")


class NotFinite(OneDemoError, ValueError):
    """An array holds NaN or infinity."""

    def __init__(self, what: str, index: Any):
        self.what, self.index = what, index
        super().__init__(f"{what} holds a value that is not finite at index {index}")


class WrongType(OneDemoError, TypeError):
    """A value is of a class that cannot be used."""

    def __init__(self, what: str, value: Any, expected: str):
        self.what, self.value, self.expected = what, value, expected
        super().__init__(f"{what} is {_described(value)}; expected {expected}")


class BadDemonstration(OneDemoError, ValueError):
    """A demonstration, or the file it comes from, cannot be used."""

    def __init__(self, path: str | Path | None, key: str, reason: str):
        self.path, self.key, self.reason = path, key, reason
        super().__init__(f"{path or 'demonstration'}: {key}: {reason}")


class BadModel(OneDemoError, ValueError):
    """A robot model (URDF, MJCF, compiled) has no such arm, or holds absurd numbers."""

    def __init__(self, source: str | Path, what: str, reason: str):
        self.source, self.what, self.reason = source, what, reason
        super().__init__(f"{source}: {what}: {reason}")


class ModelWarning(UserWarning):
    """A robot model holds what its reader does not use, or a number that looks wrong."""


class UnfitShape(OneDemoError, ValueError):
    """A shape or an obstacle has a size, a vertex or a margin that cannot be used."""

    def __init__(self, shape: str, key: str, reason: str):
        self.shape, self.key, self.reason = shape, key, reason
        super().__init__(f"{shape}: {key}: {reason}")


class UnknownName(OneDemoError, ValueError):
    """A name (robot, level, option, policy, task) that is not among the known ones."""

    def __init__(self, kind: str, name: object, known: Iterable[object]):
        self.kind, self.name, self.known = kind, name, tuple(known)
        super().__init__(f"unknown {kind} {name!r}; known: {_allowed(self.known) or 'none'}")


class BadOption(OneDemoError, ValueError):
    """An option, a setting or an argument has a value that cannot be used."""

    def __init__(self, option: str, reason: str):
        self.option, self.reason = option, reason
        super().__init__(f"option {option!r}: {reason}")


class PlanFailed(OneDemoError):
    """No plan was found, or it cannot be refined; `reason` says why in the words of the failure taxonomy."""

    def __init__(self, reason: str, detail: str):
        self.reason, self.detail = reason, detail
        super().__init__(f"{reason}: {detail}")
