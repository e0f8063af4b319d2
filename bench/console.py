"""Where words go: results to standard output, progress and errors to standard error."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


def console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """A rich console that wraps nothing and takes no text for markup; quiet ones print nothing."""
    from rich.console import Console

    return Console(stderr=stderr, quiet=quiet, highlight=False, markup=False, soft_wrap=True)


def labeled(label: str, style: str, text: str) -> Text:
    """A colored word in front of a text."""
    from rich.text import Text

    return Text.assemble((label, style), f"  {text}")
