"""`onedemo demo …`: inspect a demonstration, or make one from a recording."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from ..configs.shipped_files import demonstration_path
from .console import check_picture, check_writable, console, counted, labeled, writing

Texts = list[str] | None
app = typer.Typer(
    help="Inspect a demonstration, or make one from a recording.", no_args_is_help=True, rich_markup_mode="markdown"
)


@app.command()
def check(
    file: Annotated[str, typer.Argument(help="A demonstration (.npz), or the name of a shipped one, like stack.")],
    task: Annotated[str, typer.Option(help="Your own task, my_tasks:MY_TASK: its shapes make the skill sharper.")] = "",
    picture: Annotated[Path | None, typer.Option(help="Draw what is kept (.png, .pdf or .svg).")] = None,
) -> None:
    """Validate a demonstration and print its content.

    Prints duration, samples, the segments with the screw motion of each, what is kept while something is carried
    (docs/constraints.md), the skill that is found where objects or joints of the scene were recorded, source, licence,
    and warnings about anything unusual. Exits with code 2 and one line if the file cannot be used.

    Example: onedemo demo check stack
    """
    from ..configs import load_demonstration
    from ..planner.imitation.demonstration_warnings import warnings_of
    from .recordings.constraint_summary import constraint_lines, draw_constraints
    from .recordings.summary import facts, segment_lines, skill_lines

    path = demonstration_path(file)
    demo = load_demonstration(path)
    out = console()
    lines = facts(path, demo)
    out.print(labeled(demo.name, "bold", f"{demo.source} {demo.robot}, task {demo.task or '-'}"))
    for word, text in lines:
        out.print(f"  {word:9s} {text}")
    if demo.segments:
        out.print("segments, each with the screw from its first to its last pose in the world:")
    for segment in demo.segments:
        out.print(f"  {segment.name}", style="bold")
        for line in segment_lines(demo, segment):
            out.print(f"    {line}")
    out.print("kept while it is carried, as found in the path of the hand:")
    for line in constraint_lines(demo):
        out.print(f"  {line}")
    for line in skill_lines(demo, task):
        out.print(line)
    if picture is not None:
        check_picture(picture)
        with writing("--picture", picture):
            draw_constraints(demo, picture)
        out.print(f"wrote {picture}")
    warnings = warnings_of(demo)
    for warning in warnings:
        out.print(labeled("warning", "yellow", warning))
    out.print(labeled("ok", "green", f"with {counted(len(warnings), 'warning')}" if warnings else ""))


@app.command()
def skill(
    file: Annotated[str, typer.Argument(help="A demonstration (.npz), or the name of a shipped one, like stack.")],
    change: Annotated[
        Texts,
        typer.Option(
            "--set",
            help="What it should be: 'PHASE: KEY=VALUE', with the keys reference, goal, turns, grasp, path, gripper, "
            "skip; or 'NAME=NAME IN THE TASK'; repeatable.",
        ),
    ] = None,
    save: Annotated[bool, typer.Option("--save", help="Keep it, in the file .skill.yaml beside the demonstration.")] = (
        False
    ),
    picture: Annotated[Path | None, typer.Option(help="Draw it (.png, .pdf or .svg).")] = None,
    task: Annotated[str, typer.Option(help="Your own task, my_tasks:MY_TASK: its shapes make the skill sharper.")] = "",
) -> None:
    """Print the skill that a demonstration shows, and correct it.

    Phases are what moved relative to what, found in the paths of objects and in the gripper's command. What the
    demonstration leaves open is said; what is wrong can be set. The page docs/skills.md says how it is found.

    Examples:
    - onedemo demo skill nut_assembly --picture skill.png

    - onedemo demo skill mine.npz --set 'carry nut: reference=peg' --save
    """
    from dataclasses import replace

    from ..configs import load_demonstration
    from ..configs.skill_file import skill_file, with_said, write_corrections
    from ..planner.skills.infer import infer_skill
    from .recordings.summary import WITHOUT_SHAPES, lines_of, skill_in_task

    path = demonstration_path(file)
    demo = load_demonstration(path)
    if change:
        demo = replace(demo, corrections=with_said(demo.corrections, change))
    found = skill_in_task(demo, task) if task else infer_skill(demo)
    if picture is not None:
        from .recordings.skill_figure import draw_skill

        check_picture(picture)
        with writing("--picture", picture):
            draw_skill(demo, found, picture)
    out = console()
    for line in lines_of(found, f"skill, in {task}:" if task else WITHOUT_SHAPES):
        out.print(line)
    if save:
        beside = skill_file(path)
        with writing("--save", beside):
            write_corrections(demo.corrections, beside)
        out.print(f"wrote {beside}")
    elif change:
        out.print("not kept: --save writes it beside the demonstration")
    if picture is not None:
        out.print(f"wrote {picture}")


TABLES = "Tables of poses"
MOTIONS = "Motions and objects"


@app.command("import")
def import_(
    raw: Annotated[
        Path, typer.Argument(help="The recording: .csv, .txt or .npy poses, a teleoperation (.npz), or .hdf5.")
    ],
    output: Annotated[Path, typer.Option("--output", "-o", help="The demonstration to write (.npz).")],
    name: Annotated[str, typer.Option(help="Name of the demonstration; default: the output file's name.")] = "",
    task: Annotated[str, typer.Option(help="Task that was shown; the motions of a shipped one get its names.")] = "",
    robot: Annotated[str, typer.Option(help="Robot of the recording.")] = "Panda",
    source: Annotated[str, typer.Option(help="teleoperated, kinesthetic or scripted.")] = "",
    licence: Annotated[str, typer.Option(help="Licence of the data.")] = "unknown",
    demo: Annotated[str, typer.Option(help="HDF5 only: the episode; default: the first one.")] = "",
    units: Annotated[str, typer.Option(help="Of positions: m, cm or mm.", rich_help_panel=TABLES)] = "",
    quaternion: Annotated[
        str, typer.Option(help="Order of its columns, if nothing names them: wxyz, xyzw.", rich_help_panel=TABLES)
    ] = "",
    rotation: Annotated[
        str,
        typer.Option(
            help="What three numbers of an orientation are: rotvec, rpy, or axes, fixed (xyz) or moving (ZYX).",
            rich_help_panel=TABLES,
        ),
    ] = "",
    matrix: Annotated[
        str, typer.Option(help="Order of a matrix's numbers: rows or columns.", rich_help_panel=TABLES)
    ] = "",
    rate: Annotated[
        float | None, typer.Option(help="Samples per second, without time stamps.", rich_help_panel=TABLES)
    ] = None,
    time_unit: Annotated[str, typer.Option(help="Of time stamps: s, ms, us, ns.", rich_help_panel=TABLES)] = "",
    angles: Annotated[str, typer.Option(help="Of joints and orientations: rad or deg.", rich_help_panel=TABLES)] = "",
    columns: Annotated[
        str, typer.Option(help="Names of the columns: time,x,y,z,qw,qx,qy,qz,gripper or q1..7", rich_help_panel=TABLES)
    ] = "",
    ignore: Annotated[
        Texts, typer.Option(help="Column or key to leave out, like 'vel_*'; repeatable.", rich_help_panel=TABLES)
    ] = None,
    hand: Annotated[str, typer.Option(help="Whose pose is the hand's, of several.", rich_help_panel=TABLES)] = "",
    gripper_closed: Annotated[
        float | None, typer.Option(help="Value of the closed gripper.", rich_help_panel=TABLES)
    ] = None,
    tool: Annotated[
        str, typer.Option(help="The tcp in the recorded frame: x,y,z or x,y,z,qw,qx,qy,qz [m].", rich_help_panel=TABLES)
    ] = "",
    cut: Annotated[
        str, typer.Option(help="Where motions end: auto, gripper, rests or none.", rich_help_panel=MOTIONS)
    ] = "auto",
    segment: Annotated[
        Texts,
        typer.Option(
            help="A motion, in order: NAME, NAME=0s:3.5s or NAME=0:169 (samples), then perhaps "
            ",reference=OBJECT,held=OBJECT,gripper=close; repeatable.",
            rich_help_panel=MOTIONS,
        ),
    ] = None,
    size: Annotated[
        Texts, typer.Option(help="Size of an object: NAME=x,y,z [m]; repeatable.", rich_help_panel=MOTIONS)
    ] = None,
    place: Annotated[
        Texts,
        typer.Option(
            help="Where a thing stood: NAME=x,y,z or NAME=x,y,z,qw,qx,qy,qz [m]; repeatable.", rich_help_panel=MOTIONS
        ),
    ] = None,
) -> None:
    """Make a demonstration from a recording.

    Says what it understood of the file, and leaves nothing out without a word. Motions end where the gripper acts, or,
    if it does not, where the hand rests. The page docs/demonstrations.md goes from a recording to a run.

    Examples:
    - onedemo demo import poses.csv -o mine.npz --task stack

    - onedemo demo import poses.npy -o mine.npz --units cm --quaternion xyzw --rate 100

    - onedemo demo import low_dim.hdf5 -o mine.npz --demo demo_3 --task stack
    """
    from ..planner import save_demonstration
    from ..planner.recordings.cuts import parsed_segment
    from ..planner.recordings.pose_columns import TableRequest
    from .recordings.importing import ImportRequest, imported
    from .recordings.option_values import check_output, places_of, sizes_of, tool_of

    check_output(raw, output)
    table = TableRequest(
        units=units,
        quaternion=quaternion,
        rotation=rotation,
        matrix=matrix,
        rate=rate,
        time_unit=time_unit,
        angles=angles,
        columns=tuple(word.strip() for word in columns.split(",")) if columns else (),
        ignored=tuple(ignore or ()),
        hand=hand,
        closed=gripper_closed,
        tool=tool_of(tool),
    )
    request = ImportRequest(
        name=name or output.stem,
        robot=robot,
        task=task,
        licence=licence,
        source=source,
        table=table,
        episode=demo,
        segments=tuple(parsed_segment(text) for text in segment or ()),
        cut=cut,
        sizes=sizes_of(size or ()),
        places=places_of(place or ()),
    )
    demonstration, notes = imported(raw, request)
    with writing("--output", output):
        save_demonstration(demonstration, output)
    out = console()
    for note in notes:
        out.print(labeled("note", "cyan", note))
    motions = ", ".join(each.name for each in demonstration.segments) or "none"
    out.print(f"wrote {output}: {counted(len(demonstration.path), 'sample')}, motions: {motions}")
    out.print(f"look at it: onedemo demo check {output}")


@app.command()
def record(
    task: Annotated[str, typer.Argument(help="Task to demonstrate, like pour, or the dotted path of your own.")],
    output: Annotated[Path, typer.Option("--output", "-o", help="The demonstration to write (.npz).")],
) -> None:
    """Record the scripted demonstration of a task on the simulated robot.

    A script moves the arm along waypoints (baselines/recording, or your task's script) under physics; the recording
    holds the positions measured by the joint encoders. A demonstration that fails is not written.

    Examples:
    - onedemo demo record pour --output pour.npz

    - onedemo demo record my_tasks:PEG_IN_HOLE --output peg_in_hole.npz
    """
    import gymnasium as gym

    from ..baselines.recording.recorders import recorder_of
    from ..envs import facts_of
    from ..planner import save_demonstration

    check_writable("--output", output)
    recorder = recorder_of(task)
    env = gym.make(facts_of(task, load=True).id, level="L0", **recorder.scene)
    with console(stderr=True).status("moving the arm"):
        demo = recorder.record(env.unwrapped)
    env.close()
    with writing("--output", output):
        save_demonstration(demo, output)
    content = f"{counted(len(demo.path), 'sample')}, {counted(len(demo.segments), 'segment')}"
    console().print(f"wrote {output}: {demo.duration:.1f} s, {content}")
