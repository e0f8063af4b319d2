"""`onedemo robot survey`: the robots of a list, one after the other, each kept as it is done, and a page of all."""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Sequence
from importlib.metadata import version
from pathlib import Path

from ...configs.shipped_files import shipped_robots
from ...planner.errors import OneDemoError, UnknownName
from ..atomic_files import sha256_of, write_whole
from ..console import console, writing
from ..episodes.run_folder import alone
from ..interruption import ended
from .measured_robot import Counts, Row, measured
from .page import is_bad, line_of, page
from .robot_list import ListedRobot, read_robot_list
from .warm_up import warm_up

__all__ = ["Counts", "run_survey"]


def run_survey(
    robots: str,
    counts: Counts,
    output: Path,
    *,
    only: Sequence[str] = (),
    write: Path | None = None,
    quiet: bool = False,
) -> int:
    """Complete a folder of results, write the page, and return the exit code: 1 if a robot fails or a plan is unsound.

    Args:
        robots: file of a list of robots, or the name of a shipped one.
        counts: how much is measured of each robot.
        output: folder of the results, a file per robot.
        only: names of robots; empty: all.
        write: page to write; None: none.
        quiet: print only the folder, and errors.

    Raises:
        BadConfig: the list cannot be read, or the page not be written.
        UnknownName: a robot that the list has not, or no shipped list.
    """
    file = Path(robots)
    listed = chosen(read_robot_list(file if file.suffix or file.exists() else shipped_robots(robots)), only)
    rows: list[Row] = []

    def work() -> list[str]:
        output.mkdir(parents=True, exist_ok=True)
        with alone(output, "survey"):
            for row in _rows(listed, counts, output):
                rows.append(row)
                console(quiet=quiet).print(line_of(row))
        if write is not None:
            with writing("--write", write):
                write_whole(write, page(rows, robots))
        return [] if write is None else [str(write)]

    code = ended(work, output, "finished robots", quiet=quiet)
    return code or int(any(map(is_bad, rows)))


def chosen(listed: Sequence[ListedRobot], only: Sequence[str]) -> list[ListedRobot]:
    """Return the robots of these names, in the order of the list; without names, all.

    Args:
        listed: robots of a list.
        only: names.

    Raises:
        UnknownName: the list has no such robot.
    """
    known = [each.entry.name for each in listed]
    for name in only:
        if name not in known:
            raise UnknownName("robot", name, known)
    return [each for each in listed if not only or each.entry.name in only]


def _rows(listed: Sequence[ListedRobot], counts: Counts, output: Path) -> Iterator[Row]:
    """Yield the rows of all robots: those of the folder as they are, the missing ones measured and kept."""
    warm = False
    for robot in listed:
        same = {"name": robot.entry.name, "kind": robot.entry.kind, "package": robot.entry.package or ""}
        if robot.folder is None:
            yield {**same, "skipped": robot.install}
            continue
        if not robot.request.file.is_file():
            yield {**same, "failed": f"{robot.version or 'the list'} has no {robot.entry.file}"}
            continue
        file, conditions = output / f"{robot.entry.name}.json", conditions_of(robot, counts)
        known = _known(file, conditions)
        if known is None:
            with console(stderr=True).status(f"measuring {robot.entry.name}"):
                if not warm:  # no time of the first robot may count the compilation of kernels
                    warm_up()
                    warm = True
                known = {**same, "conditions": conditions, **_found(robot, counts)}
            write_whole(file, json.dumps(known, indent=1) + "\n")
        yield known


def _found(robot: ListedRobot, counts: Counts) -> Row:
    """Return what was measured of a robot, or why nothing could be: every failure is a finding."""
    try:
        return measured(robot, counts)
    except OneDemoError as error:
        reason = str(error)
    except Exception as error:  # an error without a name of ours is the worst finding, and others are to be measured
        reason = f"{type(error).__name__}: {' '.join(str(error).split())}"
    return {"failed": reason.replace(f"{robot.folder}{os.sep}", "")}  # the page is the same wherever packages lie


def conditions_of(robot: ListedRobot, counts: Counts) -> Row:
    """Return what decides about a row, in the form of JSON.

    Args:
        robot: its package is installed.
        counts: how much is measured.
    """
    file = robot.request.file
    return {
        "onedemo": version("onedemo"),
        "package": robot.version,
        "entry": sha256_of(repr(robot.entry)),
        "file": sha256_of(file.read_bytes().hex()),
        **counts._asdict(),
    }


def _known(file: Path, conditions: Row) -> Row | None:
    """Return a row of the folder; None if there is none of these conditions, or one that failed."""
    try:
        row = json.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return row if row.get("conditions") == conditions and "failed" not in row else None
