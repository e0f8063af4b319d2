"""`onedemo mbm`: solve MotionBenchMaker's problems, judge the motions by true meshes, and tell times beside OMPL's."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...configs import BadConfig
from ...planner.errors import UnknownName
from ..atomic_files import canonical, sha256_of, write_whole
from ..console import console
from ..episodes.run_folder import alone
from ..interruption import ended
from ..robot.mesh_judge import STEP, MeshJudge
from .moveit_files import read_archive
from .problems import Problem, read_problems
from .robot import RobotFiles, TrackRobot, robot_of, widened
from .solvers import OURS, Solve, solvers_of
from .table import Row, page, row_of, summaries
from .track_judge import judge_of

ROWS, CONDITIONS, PAGE, TABLE = "rows.jsonl", "conditions.json", "mbm.md", "mbm.json"


class Track(NamedTuple):
    """A run of the track.

    Attributes:
        files: of the robot.
        problems: file of an archive; None: the shipped problems.
        scenes: names of the scenes; empty: all.
        count: largest number of problems of each scene; None: all.
        distance: that the arm keeps from obstacles [m].
    """

    files: RobotFiles
    problems: Path | None
    scenes: tuple[str, ...]
    count: int | None
    distance: float


def run_mbm(track: Track, output: Path, *, quiet: bool = False) -> int:
    """Complete a folder of results, print the table, and return the exit code: 1 if a motion is unsound.

    Args:
        track: what is to be run.
        output: the folder.
        quiet: print only the folder, and errors.

    Raises:
        BadConfig: the problems cannot be read, or the folder holds results of other conditions.
        BadModel: the robot's model has no such arm.
        UnknownName: there is no such scene.
    """
    every = read_problems() if track.problems is None else read_archive(track.problems)
    problems = chosen(every, track.scenes, track.count)
    robot, notes = prepared(track.files, every)
    notes = [*notes, f"The arm keeps {1e3 * track.distance:g} mm from obstacles; CPU times are of one thread."]
    output.mkdir(parents=True, exist_ok=True)
    rows: list[Row] = []

    def work() -> list[str]:
        with alone(output, "mbm"):
            check_conditions(output, {**conditions_of(track), "body": sha256_of(robot.body.rows.tolist())})
            rows.extend(completed(output, problems, robot, track.distance, quiet=quiet))
            write_whole(output / PAGE, page(rows, notes))
            table = {"notes": notes, "summaries": summaries(rows), "rows": rows}
            write_whole(output / TABLE, json.dumps(table, indent=1) + "\n")
        return page(rows, notes).splitlines()

    code = ended(work, output, "finished problems", quiet=quiet)
    return code or int(any(each["unsound"] for each in summaries(rows) if each["solver"] == OURS))


def chosen(problems: Sequence[Problem], scenes: Sequence[str], count: int | None) -> list[Problem]:
    """Return the first problems of each wanted scene.

    Args:
        problems: of all scenes.
        scenes: names of the scenes; empty: all.
        count: largest number of each; None: all.

    Raises:
        UnknownName: there is no such scene.
    """
    known: dict[str, list[Problem]] = {}
    for each in problems:
        known.setdefault(each.scene, []).append(each)
    for name in scenes:
        if name not in known:
            raise UnknownName("scene", name, known)
    return [each for name in scenes or known for each in known[name][:count]]


def prepared(files: RobotFiles, problems: Sequence[Problem]) -> tuple[TrackRobot, list[str]]:
    """Return the robot, its joint limits widened to what the problems ask for, and notes about it.

    Args:
        files: of the robot.
        problems: all, so that a part of them has the same conditions.

    Raises:
        BadConfig: a joint beside the arm stands elsewhere than in the first problem.
        BadModel: the model has no such arm.
    """
    first = problems[0]
    for each in problems:
        for name in set(first.start) - set(first.goal):
            if each.start.get(name) != first.start[name]:
                what = f"stands at {each.start.get(name)}, in the first problem at {first.start[name]:g}"
                raise BadConfig(f"{each.scene} {each.number}", name, what)
    spans = {name: (min(values), max(values)) for name, values in positions_of(problems).items()}
    robot = robot_of(files, first.start, first.goal, spans)
    notes = [f"Robot: {files.urdf.name}, {len(robot.body)} capsules; judged by its meshes in steps of {STEP:g} rad."]
    return robot, [*notes, *widened(files.urdf, spans)[1]]


def positions_of(problems: Sequence[Problem]) -> dict[str, list[float]]:
    """Return every joint's positions at all starts and goals [rad or m]."""
    found: dict[str, list[float]] = {}
    for each in problems:
        for name, value in (*each.start.items(), *each.goal.items()):
            found.setdefault(name, []).append(value)
    return found


def conditions_of(track: Track) -> dict[str, Any]:
    """Return what decides about a row, in the form of JSON."""
    urdf, srdf = track.files.urdf.read_bytes(), track.files.srdf
    return {
        "onedemo": version("onedemo"),
        "problems": "shipped" if track.problems is None else sha256_of(track.problems.read_bytes().hex()),
        "urdf": sha256_of(urdf.hex()),
        "srdf": None if srdf is None else sha256_of(srdf.read_bytes().hex()),
        "tool": track.files.tool,
        "base": track.files.world_from_base.dq.tolist(),
        "distance": track.distance,
    }


def check_conditions(folder: Path, conditions: dict[str, Any]) -> None:
    """Write the conditions into a new folder; refuse a folder of other conditions.

    Args:
        folder: of the results.
        conditions: of the run.

    Raises:
        BadConfig: the folder holds results of other conditions.
    """
    file, text = folder / CONDITIONS, canonical(conditions)
    if not file.is_file():
        write_whole(file, text + "\n")
        return
    try:
        before = json.loads(file.read_text(encoding="utf-8"))
    except ValueError:
        before = {}
    if other := [key for key in conditions if before.get(key) != conditions[key]]:
        raise BadConfig(folder, ", ".join(other), "the folder holds results of another; choose another --output")


def completed(
    folder: Path, problems: Sequence[Problem], robot: TrackRobot, distance: float, *, quiet: bool = False
) -> list[Row]:
    """Return the rows of all problems; the missing ones are solved, judged and appended as they come.

    Args:
        folder: of the results.
        problems: to be solved.
        robot: the robot.
        distance: that the arm keeps from obstacles [m].
        quiet: show no progress.
    """
    from rich.progress import Progress

    known = recorded(folder / ROWS)
    solvers = solvers_of(robot, distance)
    todo = [
        (each, {name: solve for name, solve in solvers.items() if (*each.key, name) not in known}) for each in problems
    ]
    todo = [(each, missing) for each, missing in todo if missing]
    if todo:
        judge = judge_of(robot)
        warm_up(problems[0], robot, solvers)
        with (folder / ROWS).open("ab") as out, Progress(console=console(stderr=True, quiet=quiet)) as progress:
            task = progress.add_task("problems", total=len(todo))
            for problem, missing in todo:
                for row in rows_of(problem, robot, missing, judge):
                    known[row["scene"], row["number"], row["solver"]] = row
                    out.write(canonical(row).encode() + b"\n")
                out.flush()
                progress.advance(task)
    return [known[each.scene, each.number, name] for each in problems for name in solvers]


def warm_up(problem: Problem, robot: TrackRobot, solvers: dict[str, Solve]) -> None:
    """Solve a problem once with all solvers, so that no row counts the compilation.

    Args:
        problem: any.
        robot: the robot.
        solvers: by name.
    """
    start, goal = problem.joints(robot.arm.joint_names)
    for solve in solvers.values():
        solve(problem.obstacles, start, goal)


def rows_of(problem: Problem, robot: TrackRobot, solvers: dict[str, Solve], judge: MeshJudge) -> Iterator[Row]:
    """Yield the row of each solver.

    Args:
        problem: to be solved.
        robot: the robot.
        solvers: by name.
        judge: of the motions.
    """
    start, goal = problem.joints(robot.arm.joint_names)
    for name, solve in solvers.items():
        answer = solve(problem.obstacles, start, goal)
        contact = gap = None
        if answer.joints is not None:
            contact = judge.first_contact(answer.joints, problem.obstacles)
            gap = float(np.abs(answer.joints[-1] - goal).max())
        yield row_of(*problem.key, name, answer, contact, gap)


def recorded(file: Path) -> dict[tuple[str, int, str], Row]:
    """Return the rows of a file by scene, number and solver; a line torn by a crash is cut off."""
    if not file.is_file():
        return {}
    data = file.read_bytes()
    whole = data[: data.rfind(b"\n") + 1]
    if len(whole) < len(data):
        with file.open("r+b") as out:
            out.truncate(len(whole))
    rows = [json.loads(line) for line in whole.splitlines()]
    return {(row["scene"], row["number"], row["solver"]): row for row in rows}
