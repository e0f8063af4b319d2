"""Final steps of a run: pictures, videos of failures, the report, and its summary on the terminal."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...configs import Grid
from ..atomic_files import write_whole
from ..episodes.episode_records import EpisodeRecord
from ..episodes.failure_selection import FILMED, chosen, video_of
from ..episodes.run_folder import FIGURE, SHOWN, VIDEO, written_json
from ..report.report import write_report
from ..report.summary import SUMMARY, clocks, verdict, why_failed
from ..workers.dispatcher import Executor, Outcome


def show(executor: Executor, grid: Grid, folder: Path) -> None:
    """Draw figure and video of the first episode of a run with one cell, unless they exist.

    Args:
        executor: runs the job.
        grid: grid with a single cell.
        folder: run folder.
    """
    before, (cell,) = written_json(folder, SHOWN), grid.cells
    if before and (before["video"] or not cell.video):
        return
    job = {"kind": "show", "cell": cell.model_dump(mode="json"), "folder": str(folder.resolve())}
    for outcome in executor.results([job]):
        problem = _problem(outcome)
        answer = {"video": cell.video, "figure_problem": problem} if problem else outcome.answer
        write_whole(folder / SHOWN, json.dumps(answer) + "\n")


def film(executor: Executor, grid: Grid, folder: Path, records: Iterable[EpisodeRecord]) -> None:
    """Record the first failure of each kind of each method, unless that was tried before.

    Args:
        executor: runs the jobs.
        grid: the cells.
        folder: run folder.
        records: all finished episodes.
    """
    cells = {cell.digest(): cell.model_dump(mode="json") for cell in grid.cells}
    place = {digest: k for k, digest in enumerate(cells)}
    ordered = sorted(records, key=lambda record: (place[record.cell], record.index))
    before: dict[str, Any] = written_json(folder, FILMED)
    jobs = [
        {"kind": "film", "cell": cells[record.cell], "folder": str(folder.resolve()), "record": asdict(record)}
        for record in chosen(ordered)
        if video_of(record).file not in before
    ]
    for outcome in executor.results(jobs):
        file = video_of(EpisodeRecord(**outcome.job["record"])).file
        before[file] = _problem(outcome) or (outcome.answer or {})["problem"]
        write_whole(folder / FILMED, json.dumps(before, sort_keys=True, indent=1) + "\n")


def _problem(outcome: Outcome) -> str:
    """Return why a worker could not do a job at all; "" if it could."""
    answer = outcome.answer
    return f"the worker: {outcome.lost}" if answer is None else answer.get("crash") or answer.get("refused") or ""


def report(folder: Path) -> list[str]:
    """Write the report of a run folder and return the lines for the terminal.

    Raises:
        BadConfig: a file of the folder cannot be read.
    """
    files = write_report(folder)
    rows, shown = written_json(folder, SUMMARY)["rows"], written_json(folder, SHOWN)
    lines = verdict(rows[0]) if len(rows) == 1 else []
    for row in rows if len(rows) > 1 else ():
        lines += [f"{row['label']}: {verdict(row)[0]}", *why_failed(row)]
    lines += clocks(rows)
    lines += [f"report  {files[0]}", f"page    {files[1]}"]
    for name, file in (("figure", FIGURE), ("video", VIDEO)):
        if problem := shown.get(f"{name}_problem"):
            lines.append(f"no {name}: {problem}")
        elif shown and (folder / file).is_file():
            lines.append(f"{name:7} {folder / file}")
    filmed = written_json(folder, FILMED)
    lines += [f"failure {folder / file}" for file, problem in filmed.items() if not problem]
    return lines + [f"no video of failures: {problem}" for problem in dict.fromkeys(filmed.values()) if problem]
