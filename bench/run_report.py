"""The report of a run folder."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..configs.cell import RunConfig
from ..planner.errors import BadConfig
from .files import write_whole
from .records import EpisodeRecord
from .report import report_text, summary_row, verdict, write_summary
from .run_folder import read_cells, recorded, table_hash, written_json
from .scenarios import read_suite

SHOWN = "showcase.json"
FIGURE, VIDEO = "episode0.png", "episode0.mp4"


def write_report(folder: Path) -> list[str]:
    """Write `report.md` and `summary.json` from what lies in a run folder; the lines for the terminal.

    Raises:
        BadConfig: it is no run folder, or no scenarios have been drawn.
    """
    _, labeled = read_cells(folder)
    suite = read_suite(folder)
    if suite is None:
        raise BadConfig(folder, "scenarios.json", "is missing: the run has not begun")
    cells = [cell for _, cell in labeled]
    records, notes = recorded(folder, cells, suite)
    rows = []
    for label, cell in labeled:
        own = [records[key] for key in sorted(records) if key[0] == cell.digest()]
        rows.append({**summary_row(cell, own), "cell": cell.digest(), "label": label})
    write_summary(folder / "summary.json", rows)
    command = written_json(folder, "environment.json").get("command", "")
    missing = sum(len(suite.feasible(cell)) for cell in cells) - len(records)
    lines = [*notes, *([f"{missing} episodes are missing"] if missing else [])]
    if len(cells) == 1:
        text, more = _single(folder, cells[0], list(records.values()), rows[0], command)
    else:
        text, more = _table(cells[0].name, rows, command), []
    text += f"\nScenarios: {suite.summary()}.\n\nResults: sha256 {table_hash(records.values())} over all episodes, "
    write_whole(folder / "report.md", text + "the same for any executor and any number of workers.\n")
    lines += more or [f"{row['label']}: {verdict(row)[0]}" for row in rows]
    return [*lines, f"report  {folder / 'report.md'}"]


def _table(name: str, rows: list[dict[str, Any]], command: str) -> str:
    """A line for each cell."""
    lines = [f"# {name}", "", "| cell | episodes | success | safe success | Wilson 95 % |", "|---|---|---|---|---|"]
    for row in rows:
        interval = f"{row['wilson_low']:.2f} to {row['wilson_high']:.2f}"
        cells = (row["label"], row["episodes"], row["successes"], row["safe_successes"], interval)
        lines.append("| " + " | ".join(str(cell).replace("|", "/") for cell in cells) + " |")
    return "\n".join([*lines, "", "```", command, "```", ""])


def _single(
    folder: Path, cell: RunConfig, records: list[EpisodeRecord], row: dict[str, Any], command: str
) -> tuple[str, list[str]]:
    """The report of a run of one cell, with its pictures."""
    records = sorted(records, key=lambda record: record.index)
    shown, notes, lines = written_json(folder, SHOWN), [], list(verdict(row))
    if (folder / FIGURE).is_file():
        notes += [
            f"![demonstration, final paths and executed path]({FIGURE})",
            "Blue: the demonstration where it was given. Magenta: the final paths. Dashed: the executed path.",
        ]
        lines.append(f"figure  {folder / FIGURE}")
    if problem := shown.get("figure_problem"):
        notes.append(f"No figure: {problem}.")
        lines.append(f"no figure: {problem}")
    if problem := shown.get("video_problem"):
        notes.append(f"No video: {problem}.")
        lines.append(f"no video: {problem}")
    elif (folder / VIDEO).is_file() and shown.get("video"):
        notes.append(f"Video, {shown['speed']:.0f} times as fast as the simulation: [{VIDEO}]({VIDEO})")
        lines.append(f"video   {folder / VIDEO}")
    return report_text(cell, records, row, notes, command), lines
