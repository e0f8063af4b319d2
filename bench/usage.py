"""A wrong command line in words: the mistake, what may have been meant, and what is possible."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

KEYS = "KEY=VALUE"
"""Name of the argument that takes changes of a config."""


def usage_line(error: Any, words: Sequence[str] = ()) -> str:
    """Return the mistake in the command line and the valid options in one line; "" if help was printed instead.

    Args:
        error: typer's exception.
        words: the command line.
    """
    text = " ".join(error.format_message().split()).rstrip(".")
    context = getattr(error, "ctx", None)
    if not text or context is None:
        return text
    parameters = context.command.get_params(context)
    options = ", ".join(name for each in parameters for name in each.opts if name.startswith("-"))
    commands = getattr(context.command, "commands", None)
    if commands is not None:
        return f"{text}; {context.command_path} knows: {', '.join(commands)}, {options}"
    option = getattr(error, "option_name", "")
    if option.startswith("--") and any(KEYS in str(each.metavar) for each in parameters):
        text += f"; keys of a config are written without dashes: {_as_key(option, words)}"
    pieces = " ".join(context.command.collect_usage_pieces(context))
    return f"{text}; usage: {context.command_path} {pieces}; options: {options}"


def _as_key(option: str, words: Sequence[str]) -> str:
    """Return an option and its value, if it has one, as KEY=VALUE."""
    key, value = option.removeprefix("--").replace("-", "_"), "..."
    for k, word in enumerate(words):
        if word.startswith(f"{option}="):
            value = word.partition("=")[2]
        elif word == option and k + 1 < len(words) and not words[k + 1].startswith("-"):
            value = words[k + 1]
    return f"{key}={value}"
