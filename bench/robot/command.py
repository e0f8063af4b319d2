"""`onedemo robot check`: what a robot's file holds, what is not used of it, and how well capsules enclose it."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..console import COMMAND_LINE, check_picture, console, counted, labeled, writing

if TYPE_CHECKING:
    from .load_robot import LoadedRobot, RobotRequest

app = typer.Typer(help="Inspect robots' files.", no_args_is_help=True, rich_markup_mode="markdown")


@app.command()
def check(
    file: Annotated[Path, typer.Argument(help="A URDF or MJCF file.")],
    tool: Annotated[str | None, typer.Option(help="Link (URDF), or site or body (MJCF): the tool frame.")] = None,
    base_link: Annotated[str | None, typer.Option(help="Link or body where the arm begins.")] = None,
    locked: Annotated[
        list[str] | None,
        typer.Option(
            metavar="JOINT=VALUE", help="Hold a joint [rad or m]; also a pattern like 'head_*=0'; repeatable."
        ),
    ] = None,
    package_dir: Annotated[
        list[Path] | None, typer.Option(help="Folder of the packages of package://; repeatable.")
    ] = None,
    srdf: Annotated[Path | None, typer.Option(help="SRDF file with pairs of links that are not checked.")] = None,
    visuals: Annotated[bool, typer.Option("--visuals", help="Cover links without collision geometry, too.")] = False,
    picture: Annotated[Path | None, typer.Option(help="Draw capsules over geometry (.png, .pdf or .svg).")] = None,
) -> None:
    """Read arm and body of a robot, and print what they contain and what of the file is not used.

    Prints joints with limits and speeds, reach, held joints, the parts of the body with the volumes of their capsules
    and of their geometry, and warnings. Exits with code 2 and one line if the file cannot be used.

    Examples:
    - onedemo robot check panda.urdf --tool panda_hand --picture panda.png

    - onedemo robot check tiago.urdf --base-link torso_lift_link --locked torso_lift_joint=0.2
    """
    from .load_robot import RobotRequest, load_robot

    if picture is not None:
        check_picture(picture)
    request = RobotRequest(
        file,
        tool,
        base_link=base_link,
        locked=locked_joints(locked or []),
        package_dirs=package_dir or None,
        srdf=srdf,
        visuals=visuals,
    )
    with console(stderr=True).status("reading the file and covering its geometry"):
        loaded = load_robot(request)
    out = console()
    for label, style, text in report_lines(loaded, request):
        out.print(labeled(label, style, text))
    if picture is not None:
        from .picture import draw_robot

        with writing("--picture", picture):
            draw_robot(loaded, picture)
        out.print(labeled("picture   ", "", str(picture)))


def locked_joints(texts: Sequence[str]) -> dict[str, float]:
    """Return the positions of joints given as "joint=value".

    Raises:
        BadConfig: a text of another form.
    """
    from ...configs import BadConfig

    found = {}
    for text in texts:
        name, _, value = text.partition("=")
        try:
            found[name] = float(value)
        except ValueError:
            raise BadConfig(COMMAND_LINE, "--locked", f"{text!r} is not JOINT=VALUE [rad or m]") from None
    return found


def report_lines(loaded: LoadedRobot, request: RobotRequest) -> Iterator[tuple[str, str, str]]:
    """Yield label, style and text of every line for the terminal.

    Args:
        loaded: the robot.
        request: the request it answers.
    """
    from ...planner import SafetySettings
    from ...planner.collision.self_collision import body_pairs
    from .robot_summary import reach_of, volumes_of

    arm, body, report = loaded.arm, loaded.body, loaded.arm.report
    chosen = " (chosen; --tool names another)" if request.tool is None else ""
    yield "robot     ", "bold", f"{arm.name}: {arm.dof} joint{'s' if arm.dof > 1 else ''} to {loaded.tool}{chosen}"
    width = max(map(len, arm.joint_names))
    speeds = "the file has no speeds" if _without_speeds(request) else ""
    for name, kind, low, high, speed in zip(
        arm.joint_names, arm.chain[:, 7], arm.lower, arm.upper, arm.velocity_limits, strict=False
    ):
        unit = "m" if kind else "rad"
        limits = f"{low:8.3f} to {high:7.3f} {unit}" if math.isfinite(high - low) else "without limits"
        yield "joint     ", "", f"{name:{width}}  {limits:24}  {speeds or f'{speed:.4g} {unit}/s'}"
    for name, value in report.held.items():
        yield "held      ", "", f"{name} at {value:g}"
    yield "reach     ", "", f"{reach_of(arm):.3f} m from the first joint to {loaded.tool}, found by a search"
    pairs = body_pairs(arm, body, SafetySettings().self_distance)
    parts = len(set(body.names))
    checked = f"{counted(len(pairs), 'pair')} checked for contact"
    yield "body      ", "", f"{counted(len(body), 'capsule')} in {counted(parts, 'part')}; {checked}"
    closest = {(body.names[i], body.names[j]): margin for (i, j), margin in body.margins.items()}
    for (one, other), margin in closest.items():
        if margin < SafetySettings().self_distance:
            yield "close     ", "", f"{one} and {other} pass each other by little: they keep {1e3 * margin:.1f} mm"
    if request.srdf is not None:
        named = ", ".join(f"{one} and {other}" for one, other in loaded.ignored) or "none"
        yield "srdf      ", "", f"pairs of parts that it exempts: {named}"
    for piece in volumes_of(loaded):
        solid = "its geometry is swept" if math.isnan(piece.geometry) else f"its geometry {1e3 * piece.geometry:.3f} l"
        ratio = f", ratio {piece.volume / piece.geometry:.2f}" if piece.geometry > 0 else ""
        count = f"{counted(piece.capsules, 'capsule'):{len(str(piece.capsules)) + 9}}"
        yield "part      ", "", f"{piece.name:8}  {count}  {1e3 * piece.volume:7.3f} l, {solid}{ratio}"
    for line in report.unused:
        yield "not used  ", "", line
    for line in report.warnings:
        yield "warning   ", "yellow", line
    count = len(report.warnings)
    yield "ok        ", "green", f"with {counted(count, 'warning')}" if count else ""


def _without_speeds(request: RobotRequest) -> bool:
    from .load_robot import kind_of

    return kind_of(request.file) == "mujoco"
