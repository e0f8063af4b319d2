"""Scene contents as MJCF elements; collision geoms are in group 0, visual geoms in group 1.

Compiled by robosuite, only group 0 has mass; see `robosuite_model`.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from xml.etree.ElementTree import Element, SubElement

from ...planner import Mesh
from .scene_objects import (
    Beads,
    Book,
    Color,
    CompoundBody,
    FixedShape,
    FreeBody,
    Furniture,
    Glass,
    SceneSpec,
    half_sizes,
)

TURNING_FRICTION = "0.005 0.0001"
FRICTION = f"1.0 {TURNING_FRICTION}"
"""Friction coefficients: sliding, torsional, rolling."""
STAVES = 12
"""Number of boxes that form the wall of a glass."""
BEAD_SOLREF = "0.005 1"
"""Time constant [s] and damping ratio of a bead's contacts: at MuJoCo's 20 ms, falling beads sink through a 3 mm
wall."""
OBSTACLE_COLOR: Color = (0.86, 0.24, 0.16, 1.0)
PAPER: Color = (0.95, 0.92, 0.84, 1.0)
COVER = 0.0025
"""Thickness of a book's cover, and its overhang over the paper [m]."""
TITLE = (0.18, 0.62)
"""Range of the title on a book's spine, as fractions of the book's height."""
PARKED = "0 0 -3"
"""Position of an inactive obstacle [m]."""


def _text(values: Iterable[float]) -> str:
    return " ".join(f"{value:.9g}" for value in values)


def _geom(body: Element, kind: str, size: Iterable[float], color: Color, **more: str) -> None:
    """Add a collision geom and its visual twin."""
    shared = {"type": kind, "size": _text(size)}
    place = {key: more.pop(key) for key in ("pos", "quat") if key in more}
    SubElement(body, "geom", {**shared, **place, "group": "0", "rgba": "0 0 0 0", "friction": FRICTION, **more})
    _seen(body, kind, size, color, **place)


def _seen(body: Element, kind: str, size: Iterable[float], color: Color, **place: str) -> None:
    """Add a visual geom without contacts."""
    unfelt = {"group": "1", "contype": "0", "conaffinity": "0", "mass": "0"}
    SubElement(body, "geom", {"type": kind, "size": _text(size), "rgba": _text(color), **place, **unfelt})


def _free(name: str) -> Element:
    body = Element("body", {"name": name})
    SubElement(body, "joint", {"name": f"{name}_joint", "type": "free", "damping": "0.0005"})
    return body


def solid_body(solid: FreeBody) -> Element:
    """Return a free body of one shape."""
    body = _free(solid.name)
    kind, size = half_sizes(solid.shape)
    _geom(body, kind, size, solid.color, density=f"{solid.density}", condim=f"{solid.condim}")
    return body


def glass_body(glass: Glass) -> Element:
    """Return a cup of staves on a disc; the staves start above the disc, so they never touch the cup's support."""
    body = _free(glass.name)
    middle = glass.radius - 0.5 * glass.wall
    width = glass.radius * math.tan(math.pi / STAVES)
    tall = 0.5 * (glass.height - glass.wall)
    stave_mass = f"{0.8 * glass.mass / STAVES}"
    for k in range(STAVES):
        angle = 2.0 * math.pi * (k + 0.5) / STAVES
        place = {
            "pos": _text((middle * math.cos(angle), middle * math.sin(angle), 0.5 * glass.wall)),
            "quat": _text((math.cos(0.5 * angle), 0.0, 0.0, math.sin(0.5 * angle))),
        }
        _geom(body, "box", (0.5 * glass.wall, width, tall), glass.color, mass=stave_mass, condim="4", **place)
    bottom = _text((0.0, 0.0, 0.5 * (glass.wall - glass.height)))
    disc = (glass.radius, 0.5 * glass.wall)
    _geom(body, "cylinder", disc, glass.color, mass=f"{0.2 * glass.mass}", condim="4", pos=bottom)
    return body


def book_body(book: Book) -> Element:
    """Return a box that looks like two boards and a spine around paper, with a band for its title."""
    body = _free(book.name)
    x, y, z = (0.5 * size for size in book.size)
    solid = {"type": "box", "size": _text((x, y, z)), "group": "0", "rgba": "0 0 0 0", "friction": FRICTION}
    SubElement(body, "geom", {**solid, "density": f"{book.density}", "condim": "4"})
    for side in (-1.0, 1.0):
        board = _text((0.0, side * (y - 0.5 * COVER), 0.0))
        _seen(body, "box", (x, 0.5 * COVER, z), book.color, pos=board)
    _seen(body, "box", (0.5 * COVER, y, z), book.color, pos=_text((0.5 * COVER - x, 0.0, 0.0)))
    _seen(body, "box", (x - COVER, y - COVER, z - COVER), PAPER)
    low, high = (z * (2.0 * part - 1.0) for part in TITLE)
    title = (1e-4, 0.72 * y, 0.5 * (high - low))
    _seen(body, "box", title, PAPER, pos=_text((-x, 0.0, 0.5 * (low + high))))
    return body


def bead_bodies(beads: Beads) -> list[Element]:
    """Return balls without friction, on three sliding joints each.

    MuJoCo uses the larger friction of a contact pair unless one geom has priority: without it the beads stick to the
    glass.
    """
    bodies = []
    for k in range(beads.count):
        body = Element("body", {"name": f"bead{k}"})
        for axis in ("1 0 0", "0 1 0", "0 0 1"):
            SubElement(body, "joint", {"type": "slide", "axis": axis, "damping": "0.0001"})
        solid = {"condim": "1", "priority": "1", "mass": f"{beads.mass}", "solref": BEAD_SOLREF}
        _geom(body, "sphere", (beads.radius,), beads.color, **solid)
        bodies.append(body)
    return bodies


def furniture_body(furniture: Furniture) -> Element:
    """Return furniture as a mocap body, which is moved between episodes."""
    body = Element("body", {"name": furniture.name, "mocap": "true"})
    _add_parts(body, furniture, {})
    return body


def compound_body(compound: CompoundBody) -> Element:
    """Return a free body of several parts, which does not twist easily in the grasp."""
    body = _free(compound.name)
    _add_parts(body, compound, {"density": f"{compound.density}", "condim": "4"})
    return body


def mesh_assets(spec: SceneSpec) -> list[Element]:
    """Return the meshes of which compound bodies and furniture consist."""
    wholes = [each for each in (*spec.objects, *spec.furniture) if isinstance(each, CompoundBody | Furniture)]
    return [
        Element("mesh", {"name": _mesh_name(whole, k), "vertex": _text(part.shape.vertices.ravel())})
        for whole in wholes
        for k, part in enumerate(whole.parts)
        if isinstance(part.shape, Mesh)
    ]


def _mesh_name(whole: CompoundBody | Furniture, index: int) -> str:
    return f"{whole.name}_part{index}"


def _add_parts(body: Element, whole: CompoundBody | Furniture, more: dict[str, str]) -> None:
    """Add all parts to the body of the whole, each with its visual twin."""
    for k, part in enumerate(whole.parts):
        place = {"pos": _text(part.place[:3]), "quat": _text(part.place[3:])}
        solid = {**place, **more, "friction": f"{whole.friction:.9g} {TURNING_FRICTION}"}
        if isinstance(part.shape, Mesh):
            _mesh_geom(body, _mesh_name(whole, k), part, solid, place)
        else:
            _geom(body, *half_sizes(part.shape), part.color, **solid)


def _mesh_geom(body: Element, mesh: str, part: FixedShape, solid: dict[str, str], place: dict[str, str]) -> None:
    shared = {"type": "mesh", "mesh": mesh}
    SubElement(body, "geom", {**shared, **solid, "group": "0", "rgba": "0 0 0 0"})
    unfelt = {"group": "1", "contype": "0", "conaffinity": "0", "mass": "0"}
    SubElement(body, "geom", {**shared, **place, **unfelt, "rgba": _text(part.color)})


def obstacle_bodies(count: int) -> list[Element]:
    """Return bodies whose shape is set at run time; they are parked until then."""
    bodies = []
    for k in range(count):
        body = Element("body", {"name": f"obstacle{k}", "mocap": "true", "pos": PARKED})
        # contacts are switched on and off at run time, which works only for bodies compiled with contacts
        _geom(body, "sphere", (0.01, 0.01, 0.01), OBSTACLE_COLOR)
        bodies.append(body)
    return bodies
