"""How a command that may be interrupted ends: its lines and its folder, or why it stopped and what is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from .console import console, labeled

DISK_FULL, INTERRUPTED = 3, 130
"""Exit codes."""


def ended(work: Callable[[], list[str]], folder: Path, kept: str, *, quiet: bool) -> int:
    """Do the work and print its lines; returns the exit code.

    Args:
        work: what is done; its lines are for the terminal.
        folder: where results are written; printed last.
        kept: what is in it, whatever stops the work.
        quiet: print only the folder, and errors.
    """
    try:
        lines = work()
    except KeyboardInterrupt:
        console(stderr=True, quiet=quiet).print(f"stopped; {kept} are kept in {folder}, the same command goes on")
        return INTERRUPTED
    except OSError as error:
        reason = error.strerror or type(error).__name__
        text = f"{folder}: {reason}; {kept} are kept, the same command goes on"
        console(stderr=True).print(labeled("error", "red", text))
        return DISK_FULL
    out = console(quiet=quiet)
    for line in lines:
        out.print(line)
    console().print(str(folder))
    return 0
