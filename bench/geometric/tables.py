"""Tables of the geometric tier, in Markdown."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import NamedTuple

from ..statistics import holm, mcnemar, median_interval, only_one, wilson
from .jobs import FRAMES, KEY_POSES, METHODS, Row
from .suite import GeometricSuite, cells

OURS = ("screw", "repet")
TILT, DRIFT = 10.0, 0.015
"""Largest violation that still keeps the constraint: tilt in excess of the demonstration's [degrees], and rim drift
[m], which is how far inside the target glass the demonstrated lip is."""


class Column(NamedTuple):
    """A number of a path in a table.

    Attributes:
        key: name of the number in the rows.
        words: name in tables.
        factor: conversion factor from the recorded to the printed number.
        digits: number of printed decimals.
    """

    key: str
    words: str
    factor: float = 1.0
    digits: int = 2


COLUMNS = (
    Column("tilt_excess", "tilt over the demonstration's [°]", 1.0, 1),
    Column("rim_drift", "rim drift [mm]", 1e3, 2),
    Column("way", "way / demonstration's"),
    Column("turning", "rotation / demonstration's"),
    Column("jerk", "ln jerk"),
    Column("aligned", "method-aligned deviation [mm]", 1e3, 1),
    Column("ms", "ms per path", 1.0, 1),
)
"""Columns with medians over the paths that were made."""


def table(head: Sequence[str], rows: Sequence[Sequence[str]]) -> list[str]:
    """Return the lines of a table.

    Args:
        head: names of the columns.
        rows: one text per column.
    """
    return ["| " + " | ".join(line) + " |" for line in (head, ["---"] * len(head), *rows)] + [""]


def is_done(row: Row) -> bool:
    """Return whether a path reaches its goal without contact."""
    return bool(row["reached"] and row["clear"])


def is_kept(row: Row) -> bool:
    """Return whether a clear path to the goal also keeps the constraint: tilt while carrying, and lip while pouring."""
    if not is_done(row):
        return False
    drift = row["rim_drift"]
    return row["tilt_excess"] <= TILT and (drift is None or drift <= DRIFT)


def methods_in(rows: Sequence[Row]) -> list[str]:
    """Return the methods of some rows, in the order of `METHODS`."""
    found = {row["method"] for row in rows}
    return [name for name in METHODS if name in found]


def values_of(rows: Sequence[Row], key: str) -> list[float]:
    """Return the known values of a number.

    Args:
        rows: the rows.
        key: name of the number.
    """
    return [row[key] for row in rows if row.get(key) is not None]


def number(rows: Sequence[Row], column: Column) -> str:
    """Return median and interval of a number in words; – without values.

    Args:
        rows: the rows.
        column: the number and its format.
    """
    found = [column.factor * value for value in values_of(rows, column.key)]
    if not found:
        return "–"
    middle, low, high = (_rounded(value, column.digits) for value in median_interval(found))
    return f"{middle} ({low} to {high})"


def _rounded(value: float, digits: int) -> str:
    text = f"{value:.{digits}f}"
    return text[1:] if float(text) == 0.0 and text.startswith("-") else text


def share(rows: Sequence[Row], claim: Callable[[Row], bool]) -> str:
    """Return in words how many of the paths satisfy a claim, with Wilson's interval.

    Args:
        rows: the rows.
        claim: the claim about a row.
    """
    done = sum(map(claim, rows))
    low, high = wilson(done, len(rows))
    return f"{done} of {len(rows)} ({low:.2f} to {high:.2f})"


def feasibility(suite: GeometricSuite) -> Iterator[str]:
    """Yield a table of the feasible and infeasible draws of each cell."""
    lines = []
    for part, level in cells():
        mine = [each for each in suite.scenarios if (each.part, each.level) == (part, level)]
        draws = sum(each.draws for each in mine)
        if draws:
            lines.append([part, level, str(len(mine)), f"{draws}", f"{1 - len(mine) / draws:.2f}"])
    yield from table(["segment", "level", "scenarios", "draws", "share not feasible"], lines)


def levels(rows: Sequence[Row]) -> Iterator[str]:
    """Yield a table for each segment and level."""
    rows = [row for row in rows if row["track"] == "paths"]
    for part, level in cells():
        mine = [row for row in rows if (row["part"], row["level"]) == (part, level)]
        if not mine:
            continue
        used = [column for column in COLUMNS if values_of(mine, column.key)]
        yield from (f"### {part}, {level}", "")
        lines = []
        for name in methods_in(mine):
            of_method = [row for row in mine if row["method"] == name]
            shares = [share(of_method, claim) for claim in (is_done, is_kept)]
            lines.append([f"`{name}`", *shares, *(number(of_method, column) for column in used)])
        yield from table(
            ["method", "reached and clear", "constraint kept too", *(column.words for column in used)], lines
        )


def paired(rows: Sequence[Row]) -> Iterator[str]:
    """Yield paired tests of our methods against each other method with obstacles; p is corrected over a table."""
    rows = [row for row in rows if row["track"] == "paths" and row["level"] == "L3"]
    names = methods_in(rows)
    for mine in OURS:
        lines, tests = [], []
        for part in dict.fromkeys(row["part"] for row in rows if mine in names):
            here = {name: [row for row in rows if (row["part"], row["method"]) == (part, name)] for name in names}
            for name in names:
                if name != mine:
                    both = [*zip(here[mine], here[name], strict=True)]
                    lines.append([part, f"`{name}`"])
                    tests.append([only_one([(claim(a), claim(b)) for a, b in both]) for claim in (is_done, is_kept)])
        if not lines:
            continue
        corrected = [holm([mcnemar(*pairs[k]) for pairs in tests]) for k in (0, 1)]
        for line, pairs, *ps in zip(lines, tests, *corrected, strict=True):
            for (only, other), p in zip(pairs, ps, strict=True):
                line.append(f"{only} : {other} (p {p:.2g})")
        yield from table(
            ["segment", f"`{mine}` against", "reached and clear, only one of the two", "constraint kept too"], lines
        )


def sparse(rows: Sequence[Row]) -> Iterator[str]:
    """Yield tables of numbers against key poses, for each segment."""
    rows = [row for row in rows if row["track"] == "sparse"]
    shown = (COLUMNS[1], COLUMNS[0], COLUMNS[5])
    for part in dict.fromkeys(row["part"] for row in rows):
        mine = [row for row in rows if row["part"] == part]
        for column in shown:
            if not values_of(mine, column.key):
                continue
            lines = [
                [f"`{name}`"]
                + [
                    number([r for r in mine if (r["method"], r["variant"]) == (name, str(count))], column)
                    for count in KEY_POSES
                ]
                for name in methods_in(mine)
            ]
            yield from (f"### {part}: {column.words}", "")
            yield from table(["key poses", *(str(count) for count in KEY_POSES)], lines)


def frames(rows: Sequence[Row]) -> Iterator[str]:
    """Yield tables of the displacement of paths after a change of frame, without and with obstacles."""
    rows = [row for row in rows if row["track"] == "frames"]
    for level in dict.fromkeys(row["level"] for row in rows):
        mine = [row for row in rows if row["level"] == level]
        lines = []
        for name in methods_in(mine):
            cellular = [[r for r in mine if (r["method"], r["variant"]) == (name, v)] for v in FRAMES]
            lines.append([f"`{name}`", *(_gap(each) for each in cellular)])
        yield from (f"### {level}" + (", obstacles" if level == "L3" else ""), "")
        yield from table(["method", *FRAMES], lines)


def _gap(rows: Sequence[Row]) -> str:
    """Return median and largest gap [mm] in words, and how many paths were not made."""
    found = [1e3 * value for value in values_of(rows, "gap")]
    if not rows:
        return ""
    lost = len(rows) - len(found)
    note = f", {lost} not made" if lost else ""
    if not found:
        return "none made"
    if max(found) < 1e-6:
        return f"0 (below {10 * max(found):.0e}){note}"
    return f"{median_interval(found)[0]:.2g} (largest {max(found):.3g}){note}"
