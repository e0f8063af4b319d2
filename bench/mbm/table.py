"""The track's results: a row per problem and solver, summed up per scene, as Markdown and JSON."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from .solvers import OURS, Answer

Row = dict[str, Any]
REFUSED = ("start beyond a joint limit", "start in collision", "goal beyond a joint limit", "goal in collision")
"""Reasons of problems whose ends the body model does not admit."""
ENDS_AT = 1e-3
"""Largest distance [rad or m] of any joint from the goal at the end of a sound motion."""
EVERY = "all"


def row_of(scene: str, number: int, solver: str, answer: Answer, contact: object | None, gap: float | None) -> Row:
    """Return a row of the results.

    Args:
        scene: of the problem.
        number: of the problem.
        solver: name of the solver.
        answer: of the solver.
        contact: first contact that the mesh judge found; None: none.
        gap: largest distance of any joint from the goal at the end [rad or m]; None without a motion.
    """
    certificate = answer.certificate
    return {
        "scene": scene,
        "number": number,
        "solver": solver,
        "reason": answer.reason,
        "cpu": answer.cpu,
        "seconds": answer.seconds,
        "points": None if answer.joints is None else len(answer.joints),
        "gap": gap,
        "contact": None if contact is None else str(contact),
        "refused_by_judge": "; ".join(certificate.reasons) if certificate is not None else "",
        "clearance": None if certificate is None or math.isinf(certificate.clearance) else certificate.clearance,
    }


def is_refused(row: Row) -> bool:
    """Return whether the body model did not admit an end of the problem."""
    return row["reason"].startswith(REFUSED)


def is_unsound(row: Row) -> bool:
    """Return whether an answer called a success is none: a contact, a judge's refusal, or another end."""
    solved = not row["reason"]
    return solved and bool(row["contact"] or row["refused_by_judge"] or row["gap"] > ENDS_AT)


def summaries(rows: Iterable[Row]) -> list[Row]:
    """Return the sums of every scene and solver, and of all scenes.

    CPU times are of the problems that our body model admits: who refuses at once is not fast.
    """
    rows = list(rows)
    refused = {(row["scene"], row["number"]) for row in rows if row["solver"] == OURS and is_refused(row)}
    scenes = [*dict.fromkeys(row["scene"] for row in rows), EVERY]
    solvers = list(dict.fromkeys(row["solver"] for row in rows))
    found = []
    for scene in scenes:
        for solver in solvers:
            mine = [row for row in rows if row["solver"] == solver and scene in (EVERY, row["scene"])]
            if mine:
                found.append({"scene": scene, "solver": solver, **_summary(mine, refused)})
    return found


def _summary(rows: Sequence[Row], refused: set[tuple[str, int]]) -> Row:
    admitted = [row for row in rows if (row["scene"], row["number"]) not in refused]
    solved = [row for row in rows if not row["reason"]]
    times = [1e3 * row["cpu"] for row in admitted]
    motions = [row["seconds"] for row in solved if row["seconds"] is not None]
    return {
        "problems": len(rows),
        "refused": len(rows) - len(admitted),
        "unsolved": sum(bool(row["reason"]) for row in admitted),
        "solved": len(solved),
        "unsound": sum(map(is_unsound, rows)),
        "cpu_ms_median": float(np.median(times)) if times else None,
        "cpu_ms_p95": float(np.percentile(times, 95)) if times else None,
        "motion_s_median": float(np.median(motions)) if motions else None,
    }


HEAD = (
    "| scene | solver | solved | refused | unsolved | unsound | CPU ms, median | CPU ms, p95 | motion s, median |\n"
    "|---|---|---:|---:|---:|---:|---:|---:|---:|"
)


def page(rows: Sequence[Row], notes: Sequence[str]) -> str:
    """Return the results as Markdown.

    Args:
        rows: of all problems so far.
        notes: a line each, about the conditions.
    """
    lines = ["# MotionBenchMaker's problems", "", *(f"- {note}" for note in notes), "", HEAD]
    lines += [_line(each) for each in summaries(rows)]
    failures = [row for row in rows if row["solver"] == OURS and (row["reason"] or is_unsound(row))]
    if failures:
        lines += ["", "## Refused, unsolved and unsound, one by one", "", "| scene | number | why |", "|---|---:|---|"]
        lines += [f"| {row['scene']} | {row['number']} | {_why(row)} |" for row in failures]
    return "\n".join(lines) + "\n"


def _why(row: Row) -> str:
    if row["reason"]:
        return row["reason"]
    return row["contact"] or row["refused_by_judge"] or f"ends {row['gap']:.4f} from the goal"


def _line(each: Row) -> str:
    share = f"{each['solved']} of {each['problems']}"
    times = [_number(each[key]) for key in ("cpu_ms_median", "cpu_ms_p95", "motion_s_median")]
    counts = [str(each[key]) for key in ("refused", "unsolved", "unsound")]
    return f"| {' | '.join([each['scene'], each['solver'], share, *counts, *times])} |"


def _number(value: float | None) -> str:
    return "–" if value is None else f"{value:.1f}"
