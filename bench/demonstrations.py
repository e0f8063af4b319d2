"""`onedemo demo …`: inspect a demonstration, or make one from a recording."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from ..configs.shipped_files import demonstration_path
from ..planner.errors import UnknownName
from .console import check_writable, console, labeled, writing

if TYPE_CHECKING:
    from ..planner import Demonstration, Segment

IMPORTED = ("", "pour")
"""Tasks for which a pose recording can become a demonstration; "" for no task."""
app = typer.Typer(
    help="Inspect a demonstration, or make one from a recording.", no_args_is_help=True, rich_markup_mode="markdown"
)


@app.command()
def check(
    file: Annotated[str, typer.Argument(help="A demonstration (.npz), or the name of a shipped one, like stack.")],
) -> None:
    """Validate a demonstration and print its content.

    Prints duration, samples, the segments with the screw motion of each, source, licence, and warnings about anything
    unusual. Exits with code 2 and one line if the file cannot be used.

    Example: onedemo demo check stack
    """
    from ..planner import read_demonstration
    from ..planner.imitation.demonstration import warnings_of
    from ..planner.imitation.demonstration_files import UNITS

    path = demonstration_path(file)
    demo = read_demonstration(path)
    out = console()
    out.print(labeled(demo.name, "bold", f"{demo.source} {demo.robot}, task {demo.task or '-'}"))
    out.print(f"  file      {path}")
    out.print(f"  length    {demo.duration:.2f} s, {len(demo.path)} samples, {demo.path.lengths()[-1]:.2f} m (screw)")
    out.print(f"  tool      {demo.tcp_frame}, units {UNITS}")
    out.print(f"  joints    {'recorded' if demo.joint_positions is not None else 'not recorded'}")
    out.print(f"  licence   {demo.licence}")
    if demo.segments:
        out.print("segments, each with the screw from its first to its last pose in the world:")
    for segment in demo.segments:
        what, screw = _segment_lines(demo, segment)
        out.print(f"  {segment.name}", style="bold")
        out.print(f"    {what}\n    {screw}")
    warnings = warnings_of(demo)
    for warning in warnings:
        out.print(labeled("warning", "yellow", warning))
    out.print(labeled("ok", "green", f"with {len(warnings)} warnings" if warnings else ""))


@app.command("import")
def import_(
    raw: Annotated[Path, typer.Argument(help="The recording: .npz of a robosuite teleoperation, or .npy/.csv poses.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The demonstration to write (.npz).")],
    name: Annotated[str, typer.Option(help="Name of the demonstration; default: the output file's name.")] = "",
    robot: Annotated[str, typer.Option(help="Robot of the recording.")] = "Panda",
    licence: Annotated[str, typer.Option(help="Licence of the data.")] = "unknown",
    source: Annotated[str, typer.Option(help="Poses only: teleoperated, kinesthetic or scripted.")] = "kinesthetic",
    units: Annotated[str, typer.Option(help="Poses only: m, cm or mm.")] = "m",
    quaternion: Annotated[str, typer.Option(help="Poses only: order of the columns, wxyz or xyzw.")] = "wxyz",
    rate: Annotated[float, typer.Option(help="Poses only: sampling rate [Hz].")] = 0.0,
    task: Annotated[str, typer.Option(help="Poses only: pour, if a glass is held from start to end.")] = "",
) -> None:
    """Make a demonstration from a recording.

    A robosuite teleoperation (.npz with t, q, actions, obj_cubeA_jnt0, obj_cubeB_jnt0) is converted by the robot's
    forward kinematics and segmented where the gripper moves. Pose tables (.npy or .csv: x y z and a quaternion) are
    segmented where the hand rests.

    Examples (the first one makes the shipped demonstration, up to rounding):
    - onedemo demo import panda_teleop_stack.npz -o stack.npz --licence "MIT, see LICENSE-robosuite.txt"

    - onedemo demo import poses.csv --output mine.npz --units cm --quaternion xyzw --rate 100

    - onedemo demo import panda_pouring.npy -o pour_real.npz --units cm --rate 100 --task pour
    """
    from ..planner import save_demonstration
    from ..planner.imitation.import_recordings import from_pose_table, stack_from_teleoperation

    check_writable("--output", output)
    if task not in IMPORTED:
        raise UnknownName("task of a pose recording", task, IMPORTED)
    title = name or output.stem
    if raw.suffix == ".npz":
        from ..envs.scene.robots import robot_named
        from ..envs.scene.scene import robot_arm

        demo = stack_from_teleoperation(raw, robot_arm(robot_named(robot)), name=title, licence=licence)
    else:
        demo = from_pose_table(
            raw,
            name=title,
            robot=robot,
            rate=rate,
            units=units,
            quaternion=quaternion,
            source=source,
            licence=licence,
        )
        if task == "pour":
            demo = _with_glasses(demo)
    with writing("--output", output):
        save_demonstration(demo, output)
    console().print(f"wrote {output}: {len(demo.path)} samples, {len(demo.segments)} segments")


def _with_glasses(demo: Demonstration) -> Demonstration:
    """Return a recording of pouring with the glasses that were not recorded, and print where they stand."""
    from ..baselines.recording.import_pour import pour_from_poses

    placed = pour_from_poses(demo)
    for glass, top in zip(("source", "target"), placed.stands, strict=True):
        console().print(f"the {glass} is taken to stand at {' '.join(f'{value:.3f}' for value in top)} m")
    return placed.demonstration


@app.command()
def record(
    task: Annotated[str, typer.Argument(help="Task to demonstrate, like pour.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The demonstration to write (.npz).")],
) -> None:
    """Record the scripted demonstration of a task on the simulated robot.

    A script moves the arm along waypoints (baselines/recording) under physics; the recording holds the positions
    measured by the joint encoders. A demonstration that fails is not written.

    Example: onedemo demo record pour --output pour.npz
    """
    import gymnasium as gym

    from .. import envs  # noqa: F401  (registers the ids)
    from ..baselines.recording.recorders import RECORDERS
    from ..planner import save_demonstration
    from .task_table import TASKS

    check_writable("--output", output)
    if task not in RECORDERS:
        raise UnknownName("scripted demonstration", task, RECORDERS)
    recorder = RECORDERS[task]
    env = gym.make(TASKS[task].id, level="L0", **recorder.scene)
    with console(stderr=True).status("moving the arm"):
        demo = recorder.record(env.unwrapped)
    env.close()
    with writing("--output", output):
        save_demonstration(demo, output)
    console().print(f"wrote {output}: {demo.duration:.1f} s, {len(demo.path)} samples, {len(demo.segments)} segments")


def _segment_lines(demo: Demonstration, segment: Segment) -> tuple[str, str]:
    """Return two lines: what a segment does, and the screw motion from its first to its last pose."""
    import numpy as np

    from ..planner.geometry.dualquat import screw_parameters

    first, last = demo.path[segment.start], demo.path[segment.stop]
    screw = screw_parameters((last @ first.inverse()).dq)
    x, y, z = screw.axis
    axis = f"({x:+.2f} {y:+.2f} {z:+.2f})"
    carries = f"carries {segment.held}, " if segment.held else ""
    then = {"close": ", then the gripper closes", "open": ", then the gripper opens"}.get(segment.gripper, "")
    what = (
        f"samples {segment.start} to {segment.stop}, {carries}ends relative to {segment.reference or 'the world'}{then}"
    )
    if np.isfinite(screw.pitch):
        return what, (
            f"screw: {np.degrees(screw.angle):.1f} deg about {axis}, {screw.travel:+.3f} m along it, "
            f"pitch {screw.pitch:+.3f} m/rad"
        )
    return what, f"screw: {screw.travel:.3f} m along {axis}, no turn"
