"""The options of `onedemo robot survey`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

command = typer.Typer()


@command.command()
def survey(
    robots: Annotated[
        str, typer.Argument(metavar="LIST", help="A YAML file of robots, or the name of a shipped list: public.")
    ],
    write: Annotated[Path | None, typer.Option(help="Write the page with the table (.md).")] = None,
    only: Annotated[list[str] | None, typer.Option(help="Only this robot of the list; repeatable.")] = None,
    postures: Annotated[
        int, typer.Option(min=10, max=100_000, help="Random postures of each robot for its self-contact.")
    ] = 1000,
    problems: Annotated[
        int, typer.Option(min=0, max=1000, help="Problems of each kind: free, and with obstacles.")
    ] = 20,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("runs/survey"),
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Load, cover and plan for every robot of a list, and judge body and plans by the robots' true meshes.

    Robots of packages that are not installed are skipped by name, with the line that installs them. Finished robots are
    always kept, a file each: the same command continues where it stopped. Exit code 1: a plan is unsound, or a robot
    cannot be loaded, covered or planned for. A robot is measured anew if its file, its entry or the counts are others;
    after a change of the planner take another folder.

    Examples:
    - onedemo robot survey public --write docs/any_arm.md

    - onedemo robot survey public --only ur5 --postures 10000 --problems 0
    """
    from ..console import check_writable
    from .command import Counts, run_survey

    if write is not None:
        check_writable("--write", write)
    counts = Counts(postures, problems)
    raise typer.Exit(run_survey(robots, counts, output, only=only or (), write=write, quiet=quiet))
