"""The options of `onedemo mbm`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

command = typer.Typer()


@command.command()
def mbm(
    count: Annotated[int | None, typer.Option(min=1, help="Problems of each scene; default: all.")] = None,
    scenes: Annotated[
        list[str] | None, typer.Option("--scenes", help="Only this scene, like cage; repeatable.")
    ] = None,
    distance: Annotated[
        float, typer.Option(min=0.0005, max=0.05, help="Distance that the arm keeps from obstacles [m].")
    ] = 0.002,
    problems: Annotated[
        Path | None, typer.Option(help="Archive of problems as the collection has them (.tar.bz2); default: shipped.")
    ] = None,
    urdf: Annotated[Path | None, typer.Option(help="The robot; default: the Panda of example-robot-data.")] = None,
    srdf: Annotated[Path | None, typer.Option(help="Pairs of links that the judge leaves out.")] = None,
    tool: Annotated[str | None, typer.Option(help="Frame of the tcp; needed with --urdf.")] = None,
    base: Annotated[
        str | None, typer.Option(help="Pose of the root link, 'x y z qw qx qy qz'; default: the identity.")
    ] = None,
    output: Annotated[Path, typer.Option("--output", "-o", help="Folder of the results.")] = Path("runs/mbm"),
    quiet: Annotated[bool, typer.Option("--quiet", "-q", help="Print only the folder, and errors.")] = False,
) -> None:
    """Solve MotionBenchMaker's problems to their goal joints, beside OMPL's RRT-Connect, judged by true meshes.

    The 700 problems of the Panda are shipped; the robot is that of the package example-robot-data, its fingers open.
    The table tells per scene what was refused, unsolved and unsound, and CPU times. Finished problems are always kept:
    the same command continues where it stopped. Exit code 1: a motion is unsound.

    Examples:
    - onedemo mbm --count 15

    - onedemo mbm --scenes cage --distance 0.005

    - onedemo mbm --problems ur5.tar.bz2 --urdf ur5.urdf --tool tool0
    """
    from .command import Track, run_mbm
    from .robot import pose_numbers, robot_files

    files = robot_files(urdf, srdf, tool=tool, base=pose_numbers(base))
    track = Track(files, problems, tuple(scenes or ()), count, distance)
    raise typer.Exit(run_mbm(track, output, quiet=quiet))
