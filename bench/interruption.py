"""Ending of commands that may be interrupted: results and folder, or the reason for stopping and what is kept."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from .console import console, labeled

DISK_FULL, INTERRUPTED = 3, 130
"""Exit codes."""


def ended(work: Callable[[], list[str]], folder: Path, kept: str, *, quiet: bool) -> int:
    """Do the work, print its lines and the folder, and return the exit code.

    Args:
        work: does the work and returns lines for the terminal.
        folder: folder of the results; printed last.
        kept: plural noun for what the folder keeps if the work is interrupted, like "finished episodes".
        quiet: print only the folder, and errors.

    Returns:
        0, `INTERRUPTED` after Ctrl-C, or `DISK_FULL` after an error of the file system.
    """
    try:
        lines = work()
    except KeyboardInterrupt:
        console(stderr=True, quiet=quiet).print(f"stopped; {kept} are kept in {folder}, the same command continues")
        return INTERRUPTED
    except OSError as error:
        reason = error.strerror or type(error).__name__
        text = f"{folder}: {reason}; {kept} are kept, the same command continues"
        console(stderr=True).print(labeled("error", "red", text))
        return DISK_FULL
    out = console(quiet=quiet)
    for line in lines:
        out.print(line)
    console().print(str(folder))
    return 0
