"""The command `onedemo report RUN...`."""

from __future__ import annotations

from pathlib import Path

from ...configs import BadConfig
from ..console import COMMAND_LINE, console
from .report import write_report_of


def run_report(runs: list[Path], output: Path | None) -> None:
    """Write the report of run folders and print its files.

    Args:
        runs: run folders.
        output: folder of the report; None: the only run folder.

    Raises:
        BadConfig: `output` is missing for several runs, or an error of `write_report_of`.
    """
    if output is None and len(runs) > 1:
        raise BadConfig(COMMAND_LINE, "--output", "is needed where several runs are compared")
    with console(stderr=True).status("drawing figures"):
        files = write_report_of(runs, output or runs[0])
    page = next(file for file in files if file.suffix == ".html")
    for file in files:
        if file != page:
            console().print(str(file))
    console().print(str(page))
