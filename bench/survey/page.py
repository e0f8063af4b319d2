"""The page of a survey: a line per robot for the terminal, tables for the documentation."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..console import counted
from .measured_robot import AMONG, FREE, KINDS, Row, contact_of

INTRODUCTION = """# Any arm

Robots that nobody here has modelled, as public packages have them: each is loaded, its body fitted, and motions are
planned for it, which the robot's own meshes judge. One command makes this page:

```
onedemo robot survey {robots} --write docs/any_arm.md
```

Packages that are not installed are skipped by name, with the line that installs them. Finished robots are kept in the
folder `--output`, and the same command continues. `--only NAME` measures one robot, `--postures N` looks at more
postures. Nothing of these packages is part of this project; the list of their files is
[configs/robots/public.yaml](../configs/robots/public.yaml), and a list of one's own has the same form."""

BODY_COLUMNS = {
    "joints": "joints of the arm; how many of them slide, and how many turn without limits",
    "load s": "seconds to read the file and its meshes",
    "fit CPU s": "CPU seconds to cover the geometry with capsules and hulls, and to find which parts can hit each "
    "other",
    "capsules, pieces, pairs": "capsules of the body, the convex pieces in them, and pairs of capsules that are "
    "checked against each other",
    "volume": "of the capsules, as a multiple of that of the geometry in them; parts swept by fingers are left out",
    "refused": "share of random postures that the planner refuses because of the arm itself, at its default margin",
    "touching": "share of the same postures in which the meshes of two parts touch; neighbors, which share a joint, "
    "and parts that rest against each other in nearly all postures do not count",
    "clear, refused": "of the postures in which all meshes are 10 mm apart, the share that the planner refuses",
    "too far mm, too near mm": "where two checked parts are less than 20 mm apart as meshes: by how much they seem "
    "farther apart at most, which must not be, and closer at most, with the parts; parts that seem to touch count as "
    "at a distance of 0, since hulls have no depth",
}
BODIES = """## Bodies

Postures are uniform over the joints' ranges, one turn where there are no limits. What lies in a closed cavity of a mesh
touches it; what lies in an open one, like that of a base that is open to the floor, counts as clear, though nothing
gets there."""
PLAN_COLUMNS = {
    "free, among obstacles": "plans, of all problems of the kind",
    "ms": "CPU milliseconds of a plan, failures included: median, largest",
    "direct, escape, joints": "kinds of the plans: as demonstrated, by a detour of the tool, by a search in joint "
    "space",
    "unsound, certify, meshes": "plans that `certify` refuses; plans that touch an obstacle or themselves by the "
    "meshes, no joint moving more than 0.01 rad between two looks. All parts are looked at that are not neighbors and "
    "do not always rest against each other, also those that the body does not check because they can never meet",
}
PLANS = """## Plans

Start and goal are random postures that the planner does not refuse; the goal is given as the pose of the tool there,
the demonstration is the screw motion between them. Obstacles are one to three random boxes, balls, cylinders and
capsules that leave start and goal clear: a way need not exist. Random numbers depend on the robot's name alone."""


def is_bad(row: Row) -> bool:
    """Return whether a robot could not be measured, or a plan of it is unsound."""
    return "failed" in row or any(plans["unsound"] or plans["contacts"] for plans in row.get("plans", {}).values())


def line_of(row: Row) -> str:
    """Return a robot's results in one line."""
    if "skipped" in row:
        return f"skipped   {row['name']}: {row['skipped']}"
    if "failed" in row:
        return f"failed    {row['name']}: {row['failed']}"
    plans = ", ".join(f"{each['solved']} of {each['problems']} {kind}" for kind, each in row["plans"].items())
    unsound = sum(len(each["unsound"]) + len(each["contacts"]) for each in row["plans"].values())
    contact = contact_of(row)
    return (
        f"{'unsound ' if unsound else 'ok      '}  {row['name']}: {row['dof']} joints, fit {row['fit_cpu_s']:.1f} s, "
        f"refused {contact.refused:.1%}, touching {contact.touching:.1%}, clear and refused "
        f"{_share(contact.clear_refused)}, {plans}, {unsound} unsound"
    )


def page(rows: Sequence[Row], robots: str) -> str:
    """Return the results as Markdown.

    Args:
        rows: of all robots.
        robots: the list they come from, as it was named.
    """
    done = [row for row in rows if "plans" in row]
    failed, skipped = ([row for row in rows if key in row] for key in ("failed", "skipped"))
    unsound = sum(len(each["unsound"]) + len(each["contacts"]) for row in done for each in row["plans"].values())
    plans = sum(each["solved"] for row in done for each in row["plans"].values())
    sums = (
        f"{counted(len(done), 'robot')}, {len(failed)} failed, {len(skipped)} skipped; {counted(plans, 'plan')}, "
        f"{unsound} of them unsound."
    )
    text = [INTRODUCTION.format(robots=robots), sums]
    text += [BODIES, _table(_body_cells(row) for row in done), _meanings(BODY_COLUMNS)]
    text += [PLANS, _table(_plan_cells(row) for row in done), _meanings(PLAN_COLUMNS)]
    text += [_list("Failed", (f"{row['name']}: {row['failed']}" for row in failed))]
    text += [_list("Skipped", (f"{row['name']}: `{row['skipped']}`" for row in skipped))]
    text += [_list("Unsound", (f"{row['name']}, {line}" for row in done for line in _unsound(row)))]
    text += [_list("Not solved", (f"{row['name']}: {line}" for row in done for line in _reasons(row)))]
    text += [_list("Where the files are", _sources(rows))]
    return "\n\n".join(part for part in text if part) + "\n"


def _table(rows: Iterable[dict[str, str]]) -> str:
    rows = list(rows)
    if not rows:
        return ""
    lines = [list(rows[0]), ["---", "---", *["---:"] * (len(rows[0]) - 2)], *([*row.values()] for row in rows)]
    return "\n".join(f"| {' | '.join(cells)} |" for cells in lines)


def _meanings(columns: Mapping[str, str]) -> str:
    lines = (f"| {name} | {meaning} |" for name, meaning in columns.items())
    return "\n".join(["| column | meaning |", "| --- | --- |", *lines])


def _list(title: str, lines: Iterable[str]) -> str:
    found = [f"- {line}" for line in lines]
    return "\n".join([f"## {title}", "", *found]) if found else ""


def _body_cells(row: Row) -> dict[str, str]:
    contact = contact_of(row)
    joints = [str(row["dof"]), *([f"{row['sliding']} slide"] if row["sliding"] else [])]
    joints += [f"{row['endless']} endless"] if row["endless"] else []
    return {
        "robot": row["name"],
        "": " ".join([row["format"], *([row["kind"]] if row["kind"] else [])]),
        "joints": ", ".join(joints),
        "load s": f"{row['load_s']:.1f}",
        "fit CPU s": f"{row['fit_cpu_s']:.1f}",
        "capsules, pieces, pairs": f"{row['capsules']}, {row['pieces']}, {row['pairs']}",
        "volume": f"{row['capsules_l'] / row['meshes_l']:.2f}" if row["meshes_l"] else "–",
        "refused": _share(contact.refused),
        "touching": _share(contact.touching),
        "clear, refused": _share(contact.clear_refused),
        "too far mm": f"{1e3 * contact.most_over[0]:.1f}",
        "too near mm": _farthest(contact.most_under),
    }


def _plan_cells(row: Row) -> dict[str, str]:
    free, among = row["plans"][FREE], row["plans"][AMONG]
    kinds = [free[kind] + among[kind] for kind in KINDS]
    return {
        "robot": row["name"],
        "": row["format"],
        "free": f"{free['solved']} of {free['problems']}",
        "ms": _times(free["cpu_ms"]),
        "among obstacles": f"{among['solved']} of {among['problems']}",
        "ms ": _times(among["cpu_ms"]),
        "direct, escape, joints": ", ".join(map(str, kinds)),
        "unsound, certify": str(len(free["unsound"]) + len(among["unsound"])),
        "unsound, meshes": str(len(free["contacts"]) + len(among["contacts"])),
    }


def _share(value: float | None) -> str:
    return "–" if value is None else f"{100.0 * value:.1f} %"


def _farthest(found: Sequence[Any]) -> str:
    return f"{1e3 * found[0]:.1f}" + (f", {found[1]}" if found[0] > 0.0 else "")


def _times(values: Sequence[float]) -> str:
    return f"{np.median(values):.1f}, {max(values):.0f}" if len(values) else "–"


def _unsound(row: Row) -> list[str]:
    return [f"{kind}: {line}" for kind, each in row["plans"].items() for line in (*each["unsound"], *each["contacts"])]


def _reasons(row: Row) -> list[str]:
    """Reasons of failures of a robot, each with its number."""
    counts: dict[str, int] = {}
    for kind, each in row["plans"].items():
        for line in each["failures"]:
            reason = f"{kind}, {line.partition(': ')[2].partition(':')[0]}"
            counts[reason] = counts.get(reason, 0) + 1
    return [f"{count} {reason}" for reason, count in counts.items()]


def _sources(rows: Iterable[Row]) -> list[str]:
    """Packages, with the robots of each."""
    found: dict[str, list[str]] = {}
    for row in rows:
        package = row.get("conditions", {}).get("package") or row["package"]
        found.setdefault(package or "beside the list", []).append(row["name"])
    return [f"{package}: {', '.join(names)}" for package, names in found.items()]
