"""`onedemo report RUN...`."""

from __future__ import annotations

from pathlib import Path

from ...planner.errors import BadConfig
from ..console import COMMAND_LINE, console
from .report import write_report_of


def run_report(runs: list[Path], output: Path | None) -> None:
    """Write the report of run folders and say where it is.

    Raises:
        BadConfig: several runs and no `--output`, or what `write_report_of` raises.
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
