"""URDF files for tests, from short descriptions."""

from __future__ import annotations

from pathlib import Path

LIMIT = '<limit lower="-2" upper="2" effort="1" velocity="1"/>'


def link(name: str, collision: str = "", visual: str = "") -> str:
    """A link; the geometry is that of one element each, like `<sphere radius="1"/>`."""
    given = (("collision", collision), ("visual", visual))
    inside = "".join(f"<{tag}><geometry>{form}</geometry></{tag}>" for tag, form in given if form)
    return f'<link name="{name}">{inside}</link>'


def joint(
    name: str, parent: str, child: str, kind: str = "revolute", axis: str = "0 0 1", more: str = "", **origin: str
) -> str:
    """A joint; `more` stands beside its axis, and replaces the usual limit if it holds one."""
    usual = {"revolute": LIMIT, "prismatic": LIMIT, "continuous": '<limit effort="1" velocity="1"/>'}
    limit = usual.get(kind, "") if "<limit" not in more else ""
    place = "".join(f' {key}="{value}"' for key, value in origin.items())
    ends = f'<parent link="{parent}"/><child link="{child}"/>'
    return f'<joint name="{name}" type="{kind}">{ends}<origin{place}/><axis xyz="{axis}"/>{limit}{more}</joint>'


def written(folder: Path, *parts: str) -> Path:
    """The file of a robot of these parts."""
    path = folder / "robot.urdf"
    path.write_text(f'<robot name="r">{"".join(parts)}</robot>')
    return path
