"""Where words go: results to standard output, progress and errors to standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console


def console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """A rich console; quiet ones print nothing."""
    from rich.console import Console

    return Console(stderr=stderr, quiet=quiet, highlight=False)
