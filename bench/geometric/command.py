"""`onedemo geometric`: draw scenarios once, run every path generator on them, and write numbers, tables and figures."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from ...configs import BadConfig
from ...planner.errors import UnknownName
from ..atomic_files import canonical
from ..console import console, counted, labeled
from ..episodes.run_folder import LOG, alone
from ..interruption import INTERRUPTED
from ..workers.dispatcher import Dispatcher, Job, WorkerFailed
from ..workers.executors import cores
from ..workers.processes import Processes, command_of
from .jobs import FRAMES, KEY_POSES, METHODS, TRACKS, GeometricJobs, Row, key_of
from .suite import LEVELS, GeometricSuite, cells, read_suite, suite_line

CHUNK, DRAWN_AT_ONCE = 10, 5
"""Scenarios per job, for making paths and for drawing scenarios."""
WALL_SECONDS = 600.0
"""Real time after which a job counts as hung [s]."""
SPARSE_EACH, FRAMES_EACH = 12, 6
"""Largest number of scenarios for each part and level of the tracks "sparse" and "frames"."""
EXTRAS = {"dmp-goal": "movement_primitives", "dmp-world": "movement_primitives", "rrt": "ompl"}
"""Modules required by path generators."""


class GeometricRequest(NamedTuple):
    """A request for geometric results.

    Attributes:
        count: number of scenarios.
        seed: random seed of the scenarios.
        methods: names from `METHODS`.
        workers: number of processes.
    """

    count: int
    seed: int
    methods: tuple[str, ...]
    workers: int


def run_geometric(
    count: int, seed: int, output: Path, *, methods: Sequence[str] = (), workers: int | None = None, quiet: bool = False
) -> int:
    """Complete a folder of geometric results, and return the exit code.

    Args:
        count: number of scenarios.
        seed: random seed of the scenarios.
        output: the folder.
        methods: names from `METHODS`; empty: all but the sampling planner.
        workers: number of processes; None: one per core.
        quiet: print only the folder, and errors.

    Raises:
        BadConfig: the folder holds other scenarios, or a method needs a package that is not installed.
        UnknownName: there is no such method.
        WorkerFailed: a worker died, or could not do its work.
    """
    say = console(stderr=True, quiet=quiet)
    order = GeometricRequest(count, seed, wanted_methods(methods, say), workers or cores())
    output.mkdir(parents=True, exist_ok=True)
    try:
        with alone(output, "geometric"), ExitStack() as held:
            backend = Processes(command_of(GeometricJobs), output / LOG)
            dispatcher = held.enter_context(Dispatcher(backend, order.workers, WALL_SECONDS))
            begun = time.perf_counter()
            suite = frozen_suite(output, order, dispatcher)
            say.print(suite_line(suite))
            rows = completed(output, suite, order, dispatcher, say)
        say.print(f"{counted(len(rows), 'path')}, {time.perf_counter() - begun:.0f} s")
    except KeyboardInterrupt:
        say.print(labeled("stopped", "yellow", "finished paths are kept; the same command continues"))
        return INTERRUPTED
    from .report import write_geometric

    write_geometric(output, suite, rows)
    console().print(str(output))
    return 0


def wanted_methods(names: Sequence[str], say: Any) -> tuple[str, ...]:
    """Return the named methods, or all installed methods but the sampling planner.

    Args:
        names: names from `METHODS`; empty: all but the sampling planner.
        say: console for notes.

    Raises:
        UnknownName: there is no such method.
        BadConfig: a named method needs a package that is not installed.
    """
    for name in names:
        if name not in METHODS:
            raise UnknownName("method", name, METHODS)
        if missing(name):
            raise BadConfig(
                "command line", "--method", f"{name!r} needs {EXTRAS[METHODS[name].generator]}: see its extra"
            )
    if names:
        return tuple(dict.fromkeys(names))
    left_out = [name for name in METHODS if missing(name)]
    if left_out:
        say.print(labeled("note", "yellow", f"left out, not installed: {', '.join(left_out)}"))
    return tuple(name for name in METHODS if name not in left_out and name != "rrt")


def missing(name: str) -> bool:
    """Return whether a method needs a package that is not installed."""
    module = EXTRAS.get(METHODS[name].generator)
    return module is not None and find_spec(module) is None


def frozen_suite(folder: Path, order: GeometricRequest, dispatcher: Dispatcher) -> GeometricSuite:
    """Return the scenarios of a folder; draw and write them if there are none.

    Args:
        folder: folder of the results.
        order: the request.
        dispatcher: gives jobs to workers.

    Raises:
        BadConfig: the folder holds other scenarios than requested.
        WorkerFailed: a worker died, or could not do its work.
    """
    suite = read_suite(folder)
    if suite is None:
        jobs = [
            {"kind": "draw", "cell": {}, "seed": order.seed, "indices": indices}
            for indices in chunks(range(order.count), DRAWN_AT_ONCE)
        ]
        lines = [line for answer in answers(dispatcher, jobs) for line in answer["drawn"]]
        suite = GeometricSuite(order.seed, sorted(lines, key=lambda line: line["index"]))
        suite.write(folder)
    elif (suite.seed, len(suite.lines)) != (order.seed, order.count):
        what = f"holds {counted(len(suite.lines), 'scenario')} of seed {suite.seed}; choose another --output"
        raise BadConfig(folder, "suite.jsonl", what)
    return suite


def wanted_rows(suite: GeometricSuite, order: GeometricRequest) -> Iterator[tuple[str, str, str, int]]:
    """Yield track, variant, method and scenario index of every requested row, in the order of the tables.

    Args:
        suite: the scenarios.
        order: the request.
    """
    for each in suite.scenarios:
        for method in chosen(TRACKS["paths"], order):
            yield "paths", each.level, method, each.index
    for variant in map(str, KEY_POSES):
        for index in first_of_each(suite, ("L1",), SPARSE_EACH):
            for method in chosen(TRACKS["sparse"], order):
                yield "sparse", variant, method, index
    for variant in FRAMES:
        for index in first_of_each(suite, tuple(LEVELS), FRAMES_EACH):
            for method in chosen(TRACKS["frames"], order):
                if variant != "tool, guide by length" or method in ("tsia", "decoupled"):
                    yield "frames", variant, method, index


def chosen(names: Sequence[str], order: GeometricRequest) -> list[str]:
    """Return the requested methods of a track.

    Args:
        names: methods of the track.
        order: the request.
    """
    return [name for name in names if name in order.methods]


def first_of_each(suite: GeometricSuite, levels: Sequence[str], count: int) -> list[int]:
    """Return the indices of the first scenarios of each part and level.

    Args:
        suite: the scenarios.
        levels: levels to include.
        count: largest number of scenarios for each part and level.
    """
    found = []
    for cell in cells():
        here = [each.index for each in suite.scenarios if (each.part, each.level) == cell and cell[1] in levels]
        found += here[:count]
    return found


def completed(
    folder: Path, suite: GeometricSuite, order: GeometricRequest, dispatcher: Dispatcher, say: Any
) -> list[Row]:
    """Return all rows of the folder in the order of the tables; make and append the missing requested rows.

    Args:
        folder: folder of the results.
        suite: the scenarios.
        order: the request.
        dispatcher: gives jobs to workers.
        say: console for notes and progress.

    Raises:
        WorkerFailed: a worker died, or could not do its work.
    """
    from rich.progress import Progress

    file = folder / f"rows-{suite.hash[:12]}.jsonl"
    known, wanted = recorded(file, say), list(wanted_rows(suite, order))
    todo = [key for key in wanted if key not in known]
    if len(todo) < len(wanted):
        say.print(f"{len(wanted) - len(todo)} of {counted(len(wanted), 'path')} made before")
    with file.open("ab") as out, Progress(console=say, transient=True) as progress:
        task = progress.add_task("paths", total=len(todo))
        for answer in answers(dispatcher, jobs_for(folder, todo)):
            for row in answer["rows"]:
                known[key_of(row)] = row
                out.write(canonical(row).encode() + b"\n")
            out.flush()
            progress.update(task, advance=len(answer["rows"]))
    every = wanted_rows(suite, order._replace(methods=tuple(METHODS)))
    return [known[key] for key in every if key in known]


def jobs_for(folder: Path, todo: Iterable[tuple[str, str, str, int]]) -> list[Job]:
    """Return jobs of several scenarios each for the missing rows.

    Args:
        folder: folder of the results.
        todo: track, variant, method and scenario index of each missing row.
    """
    groups: dict[tuple[str, str, int], list[str]] = {}
    for track, variant, method, index in todo:
        groups.setdefault((track, variant, index), []).append(method)
    alike: dict[tuple, list[int]] = {}
    for (track, variant, index), methods in groups.items():
        alike.setdefault((track, variant, tuple(methods)), []).append(index)
    return [
        {"kind": "rows", "cell": {}, "folder": str(folder.resolve()), "track": track, "variant": variant,
         "methods": list(methods), "indices": indices}
        for (track, variant, methods), every in alike.items()
        for indices in chunks(every, CHUNK)
    ]  # fmt: skip


def recorded(file: Path, say: Any) -> dict[tuple[str, str, str, int], Row]:
    """Return the rows of a file; a line torn by a crash is cut off, other invalid lines are reported and skipped.

    Args:
        file: file of rows; it may be missing.
        say: console for warnings.

    Returns:
        Rows by track, variant, method and scenario index.
    """
    if not file.is_file():
        return {}
    data, rows = file.read_bytes(), {}
    whole = data[: data.rfind(b"\n") + 1]
    if len(whole) < len(data):
        with file.open("r+b") as out:
            out.truncate(len(whole))
    for number, line in enumerate(whole.splitlines(), start=1):
        try:
            row = json.loads(line)
            rows[key_of(row)] = row
        except (ValueError, KeyError, TypeError):
            say.print(labeled("warning", "yellow", f"{file}: line {number} is no row and is passed over"))
    return rows


def answers(dispatcher: Dispatcher, jobs: Sequence[Job]) -> Iterator[dict[str, Any]]:
    """Yield the answers to jobs as they arrive.

    Args:
        dispatcher: gives jobs to workers.
        jobs: the jobs.

    Raises:
        WorkerFailed: a worker was lost twice, or answered with an error.
    """
    for outcome in dispatcher.results(jobs):
        answer = outcome.answer
        if answer is None:
            raise WorkerFailed(f"{LOG}: a worker was lost twice ({outcome.lost})")
        if problem := answer.get("crash") or answer.get("refused"):
            raise WorkerFailed(f"{LOG}: {problem}")
        yield answer


def chunks(values: Sequence[int], size: int) -> list[list[int]]:
    """Split values into consecutive lists.

    Args:
        values: the values.
        size: largest length of a list.
    """
    every = list(values)
    return [every[k : k + size] for k in range(0, len(every), size)]
