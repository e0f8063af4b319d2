"""`report.md`, `report.html`, figures and tables of run folders, made from their files; nothing is run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ...configs import BadConfig
from ..atomic_files import write_whole
from ..console import counted
from ..document.document import Block, Bullets, Code, Document, Heading, Link, Paragraph, Picture, Pictures, Table
from ..document.html_page import html_of
from ..document.markdown_page import markdown_of
from ..document.untrusted_text import link_to
from ..episodes.failure_selection import FILMED, videos_beside
from ..episodes.run_folder import FIGURE, SHOWN, VIDEO, table_hash, written_json
from ..method_table import REFERENCE
from ..metrics.metric_table import METRICS
from ..statistics import FEWEST
from . import tables
from .groups import UNSAFE, Group, groups_of, metric_tests, success_tests
from .pictures import drawn, with_caption
from .read_runs import Run, merged, read_run
from .summary import SUMMARY, clocks, summary_row, write_summary
from .tables_csv import write_tables

INTERVALS = "Whiskers and brackets are Wilson 95 % intervals of single cells; nothing is pooled over levels."
TESTS = (
    f"Every method against {REFERENCE} on the scenarios that both have run: the same starts, goals, obstacles and "
    f"seeds. A : B means that in A pairs {REFERENCE} alone succeeded and in B the method alone; p is of the exact "
    "McNemar test, after Holm's correction over all tasks and levels of the method. The number of episodes was fixed "
    "by the config before the first one ran."
)
DIFFERENCES = (
    f"Means over at least {FEWEST} pairs of scenarios, {REFERENCE} less the method, with studentized bootstrap 95 % "
    "intervals (seed 0). A metric of successes compares pairs in which both succeeded. Holm's correction is over all "
    "tasks and levels of a method and a metric."
)


def write_report(folder: Path) -> list[Path]:
    """Write the report of one run folder into the folder.

    Returns:
        The files written, the report itself first.

    Raises:
        BadConfig: the folder is not a run folder, or a file in it cannot be read.
    """
    return write_report_of([folder], folder)


def write_report_of(folders: list[Path], output: Path) -> list[Path]:
    """Write one report of several run folders of the same scenarios.

    Args:
        folders: run folders.
        output: folder of the report.

    Returns:
        The files written, the report itself first.

    Raises:
        BadConfig: a folder cannot be used, the runs have different scenarios, or the report cannot be written.
    """
    run = merged([read_run(folder) for folder in folders])
    try:
        output.mkdir(parents=True, exist_ok=True)
        document = _document(run, output)
        files = [output / "report.md", output / "report.html"]
        for file, text in zip(files, (markdown_of(document), html_of(document)), strict=True):
            write_whole(file, text)
        write_summary(output / SUMMARY, _rows(run))
        return [*files, output / SUMMARY, *write_tables(run, output)]
    except OSError as error:
        raise BadConfig(output, "", f"no report can be written: {error.strerror or error}") from None


def _rows(run: Run) -> list[dict[str, Any]]:
    """Return a row of `summary.json` for each cell."""
    return [
        {**summary_row(cell, run.records[digest]), "cell": digest, "label": run.labels[digest]}
        for digest, cell in run.cells.items()
    ]


def _document(run: Run, output: Path) -> Document:
    groups = groups_of(run)
    pictures = drawn(run, groups, output)
    shown = {kind: with_caption(found, CAPTIONS[kind]) for kind, found in pictures.items()}
    names = list(dict.fromkeys(cell.name for cell in run.cells.values()))
    cells, episodes = len(groups), sum(len(group.records) for group in groups)
    document = Document(f"{', '.join(names)}: {counted(cells, 'cell')}, {counted(episodes, 'episode')}")
    document.blocks += [
        *_opening(run, groups),
        Heading(2, "Safe success"),
        tables.headline(groups, lambda group: group.safe_success),
        *shown["success"],
        Heading(2, "Success"),
        tables.headline(groups, lambda group: group.success),
        tables.counts(groups),
        *_tests(groups),
        *([Heading(2, "Success against the speed of obstacles"), *shown["speed"]] if shown["speed"] else []),
        Heading(2, "Failures"),
        *shown["failures"],
        *_failures(groups, run, output),
        Heading(2, "Quality of motion"),
        *_metrics(groups),
        *shown["clearance"],
        Heading(2, "Planner time"),
        tables.timing(groups),
        *shown["timing"],
        Heading(2, "What each method needs"),
        tables.costs(groups),
        *_first_episodes(run, output),
        *_repeating(run),
    ]
    return document


def _first_episodes(run: Run, output: Path) -> list[Block]:
    """Return figures and videos of the first episodes, or the reasons why there are none."""
    blocks = []
    for folder in run.folders:
        shown = written_json(folder, SHOWN)
        of = f" of {folder.name}" if len(run.folders) > 1 else ""
        blocks += _first_episode(shown, folder, of, output) if shown else []
    return [Heading(2, "The first episode"), *blocks] if blocks else []


def _first_episode(shown: dict[str, Any], folder: Path, of: str, output: Path) -> list[Block]:
    blocks: list[Block] = []
    figure, video = folder / FIGURE, folder / VIDEO
    if figure.is_file():
        words = "demonstration, final and executed paths"
        picture = Picture(link_to(figure, output), figure.read_bytes(), words, "png")
        blocks.append(Pictures([picture], f"The episode{of}. {PATHS}" if of else PATHS))
    if video.is_file() and not shown.get("video_problem"):
        speed = f"the episode{of}, {shown.get('speed', 1.0):.0f} times as fast as the simulation"
        blocks.append(Table(["what", "file"], [[speed, Link(VIDEO, link_to(video, output))]]))
    problems = {"figure": shown.get("figure_problem"), "video": shown.get("video_problem")}
    missing = [f"No {what}{of}: {problem}." for what, problem in problems.items() if problem]
    return [*blocks, Bullets(missing)] if missing else blocks


PATHS = "Blue: the demonstration where it was given. Magenta: the final paths. Dashed: the executed path."
CAPTIONS = {
    "success": f"Safe success (success without any unwanted contact) by level. {INTERVALS}",
    "speed": "Safe success of all episodes with obstacles against the largest speed of any of them in the scenario, "
    "with Wilson 95 % intervals.",
    "failures": "How the episodes of each cell ended, by the taxonomy of the tasks.",
    "clearance": "Distribution of the smallest clearance of robot and held object over all episodes with obstacles.",
    "timing": "Time of the policy per tick over all levels: median and 99th percentile (medians over episodes), "
    "and the longest of all.",
}


def _opening(run: Run, groups: list[Group]) -> list[Block]:
    missing = sum(max(0, group.planned - len(group.records)) for group in groups)
    cells = list(run.cells.values())
    conditions, labels = [cell.condition for cell in cells], [group.label for group in groups]
    words = {"tasks": [cell.task_words for cell in cells], "levels": conditions, "methods": labels}
    items = [
        *(f"{what}: {', '.join(dict.fromkeys(names))}" for what, names in words.items()),
        "Success is judged by the simulator; safe success is success without any unwanted contact.",
        *(f"{line[0].upper()}{line[1:]}." for line in clocks(_rows(run))),
        f"Scenarios: {run.suite.summary()}.",
        *([f"Unfinished: {missing} of the planned episodes are missing."] if missing else []),
        *run.warnings,
    ]
    return [Bullets(items)]


def _tests(groups: list[Group]) -> list[Block]:
    safe = success_tests(groups, lambda record: record.safe_success)
    if not safe:
        return []
    plain = success_tests(groups, lambda record: record.success)
    tests = [Heading(3, "Safe success"), tables.success_tests(groups, safe)]
    tests += [Heading(3, "Success"), tables.success_tests(groups, plain)]
    return [Heading(2, f"Paired tests against {REFERENCE}"), Paragraph(TESTS), *tests]


def _failures(groups: list[Group], run: Run, output: Path) -> list[Block]:
    films = videos_beside(run.folders, output)
    table = tables.failures(groups, films)
    filmed = [written_json(folder, FILMED) for folder in run.folders]
    problems = dict.fromkeys(problem for each in filmed for problem in each.values() if problem)
    missing = [Bullets([f"Failures without a video: {problem}." for problem in problems])] if problems else []
    every = [tables.every_failure(groups, films)] if table.rows and len(groups) == 1 else []
    unsafe = [tables.unsafe_successes(groups)] if any(group.outcomes[UNSAFE] for group in groups) else []
    return [table if table.rows else Paragraph("None."), *missing, *every, *unsafe]


def _metrics(groups: list[Group]) -> list[Block]:
    blocks: list[Block] = []
    used: list[str] = []
    for task in dict.fromkeys(group.cell.task for group in groups):
        some = [group for group in groups if group.cell.task == task]
        names = tables.known_metrics(some)
        if names:
            main = [name for name in names if METRICS[name].paired]
            blocks += [Heading(3, task), tables.metrics(some, main)] if main else []
            blocks += [tables.metrics(some, names, f"All metrics of {task}")] if names != main else []
            used += names
    if not blocks:
        return [Paragraph("No episode has any metric.")]
    tests = metric_tests(groups)
    said = Paragraph(
        "Interquartile means over episodes; those of lengths, times, errors and smoothness over successes."
    )
    meanings = [f"{m.words}: {m.meaning}{_better(m.better)}" for name, m in METRICS.items() if name in used]
    differences = (
        [Heading(3, "Paired differences"), Paragraph(DIFFERENCES), tables.metric_tests(groups, tests)] if tests else []
    )
    return [said, *blocks, Bullets(meanings), *differences]


def _better(better: str) -> str:
    return f" ({better} is better)" if better else ""


def _left_out(run: Run) -> str:
    """Return what the hash of the results leaves out."""
    live = any(not record.reproducible for record in run.every)
    return "times and episodes with a real clock left out" if live else "times left out"


def _repeating(run: Run) -> list[Block]:
    environment = {key: value for key, value in run.environment.items() if key not in ("packages", "command")}
    packages = run.environment.get("packages")
    versions = (
        ", ".join(f"{name} {version}" for name, version in packages.items()) if isinstance(packages, dict) else ""
    )
    folders = [folder.name for folder in run.folders]
    again = [f"onedemo report {' '.join(folders)} --output comparison"] if len(folders) > 1 else []
    command = run.command or "\n".join([*(f"onedemo run {name}/config.yaml" for name in folders), *again])
    return [
        Heading(2, "How to repeat it"),
        Code(command),
        Bullets(
            [
                f"hash of the scenarios: {run.suite.hash}",
                f"hash of the results, {_left_out(run)}, the same for any executor: {table_hash(run.every)}",
                *(f"{key}: {value}" for key, value in environment.items()),
                *([f"versions: {versions}"] if versions else []),
            ]
        ),
        Paragraph(
            "Every episode is in episodes.jsonl and episodes.csv, every cell in summary.csv and summary.json, the "
            "whole config in config.yaml, starts and obstacles in scenarios.json; figures are there as PNG and PDF."
        ),
    ]
