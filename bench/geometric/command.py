"""`onedemo geometric`: scenarios drawn once, paths made by every path maker, numbers, tables and figures out."""

from __future__ import annotations

import json
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack
from importlib.util import find_spec
from pathlib import Path
from typing import Any, NamedTuple

from ...planner.errors import BadConfig, UnknownName
from ..atomic_files import canonical
from ..console import console, labeled
from ..episodes.run_folder import LOG, alone
from ..interruption import INTERRUPTED
from ..workers.dispatcher import Dispatcher, Job, WorkerFailed
from ..workers.executors import cores
from ..workers.processes import Processes, command_of
from .jobs import FRAMES, KEY_POSES, METHODS, TRACKS, GeometricJobs, Row, key_of
from .suite import LEVELS, GeometricSuite, cells, read_suite, suite_line

CHUNK, DRAWN_AT_ONCE = 10, 5
"""Scenarios of a job."""
WALL_SECONDS = 600.0
SPARSE_EACH, FRAMES_EACH = 12, 6
"""Scenarios for each part and level of these tracks, at most."""
EXTRAS = {"dmp-goal": "movement_primitives", "dmp-world": "movement_primitives", "rrt": "ompl"}
"""Modules that path makers need."""


class GeometricRequest(NamedTuple):
    """What is wanted.

    Attributes:
        count: of scenarios.
        seed: that they are drawn from.
        methods: names of METHODS.
        workers: processes.
    """

    count: int
    seed: int
    methods: tuple[str, ...]
    workers: int


def run_geometric(
    count: int, seed: int, output: Path, *, methods: Sequence[str] = (), workers: int | None = None, quiet: bool = False
) -> int:
    """Complete a folder of geometric results; returns the exit code.

    Args:
        count: of scenarios.
        seed: that they are drawn from.
        output: the folder.
        methods: names of METHODS; none: all but the sampler.
        workers: processes; None: one for each core.
        quiet: print only the folder, and errors.

    Raises:
        BadConfig: the folder holds other scenarios.
        UnknownName: no such method.
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
        say.print(f"{len(rows)} paths, {time.perf_counter() - begun:.0f} s")
    except KeyboardInterrupt:
        say.print(labeled("stopped", "yellow", "what is done is kept; the same command goes on"))
        return INTERRUPTED
    from .report import write_geometric

    write_geometric(output, suite, rows)
    console().print(str(output))
    return 0


def wanted_methods(names: Sequence[str], say: Any) -> tuple[str, ...]:
    """The methods that are named, or all that can be run here but the sampler.

    Raises:
        UnknownName: no such method.
        BadConfig: one that is named needs what is not installed.
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
    """Whether what a method needs is not installed."""
    module = EXTRAS.get(METHODS[name].generator)
    return module is not None and find_spec(module) is None


def frozen_suite(folder: Path, order: GeometricRequest, dispatcher: Dispatcher) -> GeometricSuite:
    """The scenarios of a folder, drawn if there are none.

    Raises:
        BadConfig: they are others than those that are wanted.
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
        what = f"holds {len(suite.lines)} scenarios of seed {suite.seed}; choose another --output"
        raise BadConfig(folder, "suite.jsonl", what)
    return suite


def wanted_rows(suite: GeometricSuite, order: GeometricRequest) -> Iterator[tuple[str, str, str, int]]:
    """Track, variant, method and scenario of every row, in the order of the tables."""
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
    """Those methods of a track that are wanted."""
    return [name for name in names if name in order.methods]


def first_of_each(suite: GeometricSuite, levels: Sequence[str], count: int) -> list[int]:
    """The first scenarios of each part at some levels."""
    found = []
    for cell in cells():
        here = [each.index for each in suite.scenarios if (each.part, each.level) == cell and cell[1] in levels]
        found += here[:count]
    return found


def completed(
    folder: Path, suite: GeometricSuite, order: GeometricRequest, dispatcher: Dispatcher, say: Any
) -> list[Row]:
    """All rows of the folder, in the tables' order; what is wanted and missing is made, and written as it comes."""
    from rich.progress import Progress

    file = folder / f"rows-{suite.hash[:12]}.jsonl"
    known, wanted = recorded(file, say), list(wanted_rows(suite, order))
    todo = [key for key in wanted if key not in known]
    if len(todo) < len(wanted):
        say.print(f"{len(wanted) - len(todo)} of {len(wanted)} paths were made before")
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
    """Jobs of some scenarios each, with the methods that are missing of them."""
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
    """The rows of a file; a line that a crash tore is cut off, any other that is none is named and passed over."""
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
    """The answers to jobs, as they come.

    Raises:
        WorkerFailed: there is none, or an error.
    """
    for outcome in dispatcher.results(jobs):
        answer = outcome.answer
        if answer is None:
            raise WorkerFailed(f"{LOG}: a worker was lost twice ({outcome.lost})")
        if problem := answer.get("crash") or answer.get("refused"):
            raise WorkerFailed(f"{LOG}: {problem}")
        yield answer


def chunks(values: Sequence[int], size: int) -> list[list[int]]:
    """Lists of at most `size`."""
    every = list(values)
    return [every[k : k + size] for k in range(0, len(every), size)]
