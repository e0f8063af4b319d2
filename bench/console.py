"""Where words and files go: results to standard output, progress and errors to standard error."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

from ..planner.errors import BadConfig

COMMAND_LINE = "command line"
NO_LIBRARY = "cannot open shared object file"
PACKAGES = "apt install libgl1 libglib2.0-0"

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


def missing_library(error: BaseException) -> str:
    """What to install, if an error says that a shared library is missing; else ""."""
    if not isinstance(error, ImportError | OSError) or NO_LIBRARY not in str(error):
        return ""
    library = str(error).partition(":")[0]
    return f"the library {library} is missing, which OpenCV in robosuite loads: {PACKAGES}"


def check_writable(option: str, path: Path) -> None:
    """Refuse a file that cannot be written, before the work that it is for.

    Raises:
        BadConfig: naming the option, the path and why.
    """
    folder = path.parent
    if path.is_dir():
        raise BadConfig(COMMAND_LINE, option, f"{path} is a folder, not a file")
    if not folder.is_dir():
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: there is no folder {folder}")
    if not os.access(path if path.exists() else folder, os.W_OK):
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: no permission")


@contextmanager
def writing(option: str, path: Path) -> Iterator[None]:
    """Make it one line if a file cannot be written after all.

    Raises:
        BadConfig: naming the option, the path and why.
    """
    try:
        yield
    except OSError as error:
        raise BadConfig(COMMAND_LINE, option, f"{path} cannot be written: {error.strerror or error}") from None
