"""Terminal output: results go to standard output, progress and errors to standard error."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..configs import BadConfig

COMMAND_LINE = "command line"
NO_LIBRARY = "cannot open shared object file"
PACKAGES = "apt install libgl1 libglib2.0-0"
PICTURES = (".png", ".pdf", ".svg")
"""Allowed suffixes of a picture."""

if TYPE_CHECKING:
    from rich.console import Console
    from rich.text import Text


def console(*, stderr: bool = False, quiet: bool = False) -> Console:
    """Return a rich console that neither wraps lines nor interprets markup.

    Args:
        stderr: write to standard error instead of standard output.
        quiet: print nothing.
    """
    from rich.console import Console

    return Console(stderr=stderr, quiet=quiet, highlight=False, markup=False, emoji=False, soft_wrap=True)


def counted(count: int, noun: str) -> str:
    """Return a number with its noun: "1 scenario", "2 scenarios".

    Args:
        count: the number.
        noun: the noun in the singular; its plural ends in s.
    """
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def labeled(label: str, style: str, text: str) -> Text:
    """Return a text with a colored label in front.

    Args:
        label: word in front of the text.
        style: rich style of the label, like "red" or "bold".
        text: text after the label, in the default style.
    """
    from rich.text import Text

    return Text.assemble((label, style), f"  {text}")


def missing_library(error: BaseException) -> str:
    """Return advice on packages to install if an error reports a missing shared library, else ""."""
    if not isinstance(error, ImportError | OSError) or NO_LIBRARY not in str(error):
        return ""
    library = str(error).partition(":")[0]
    return f"the library {library} is missing, which OpenCV in robosuite loads: {PACKAGES}"


def check_writable(option: str, path: Path) -> None:
    """Refuse an unwritable output file before the work starts.

    Args:
        option: command line option that named the file.
        path: file to be written later.

    Raises:
        BadConfig: the file cannot be written; the error names option, path and reason.
    """
    folder = path.parent
    if path.is_dir():
        raise BadConfig(COMMAND_LINE, option, f"{path} is a folder, not a file")
    if not folder.is_dir():
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: there is no folder {folder}")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: no permission")


def check_picture(picture: Path) -> None:
    """Refuse a file of `--picture` that is no picture, or cannot be written.

    Raises:
        BadConfig: the error names option, path and reason.
    """
    if picture.suffix.lower() not in PICTURES:
        raise BadConfig(COMMAND_LINE, "--picture", f"{picture} does not end in {', '.join(PICTURES)}")
    check_writable("--picture", picture)


@contextmanager
def writing(option: str, path: Path) -> Iterator[None]:
    """Turn an `OSError` inside the `with` block into a one-line error.

    Args:
        option: command line option that named the file.
        path: file written inside the block.

    Raises:
        BadConfig: the file cannot be written; the error names option, path and reason.
    """
    try:
        yield
    except OSError as error:
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: {error.strerror or error}") from None
