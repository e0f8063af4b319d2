"""Parts of things from meshes and MJCF models."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from ...planner.errors import BadOption
from ..guests.solids import body_solids, solid_geoms
from ..mujoco_library import compiled_model, mujoco
from .things import Part


def parts_of_mesh(file: str | Path, scale: float = 1.0) -> tuple[Part, ...]:
    """Return the convex hull of a mesh as the part of a thing; a hollow thing needs a file for each convex piece.

    Args:
        file: .stl, .obj or .msh.
        scale: factor to meters: 0.001 for millimeters.

    Raises:
        BadOption: the file cannot be read, or is no solid.
    """
    root = Element("mujoco")
    size = f"{scale:.9g} {scale:.9g} {scale:.9g}"
    SubElement(SubElement(root, "asset"), "mesh", {"name": "mesh", "file": str(Path(file).resolve()), "scale": size})
    body = SubElement(SubElement(root, "worldbody"), "body", {"name": "thing"})
    SubElement(body, "geom", {"type": "mesh", "mesh": "mesh"})
    return _parts(tostring(root, encoding="unicode"), file, "thing")


def parts_of_mjcf(file: str | Path, body: str = "") -> tuple[Part, ...]:
    """Return the collision geoms of a body of an MJCF model as the parts of a thing, in the body's frame.

    Primitives stay as they are, meshes become their hulls.

    Args:
        file: MJCF model.
        body: name of the body; "": the first one.

    Raises:
        BadOption: the file cannot be read, or has no such body, or the body no collision geom.
    """
    return _parts(Path(file), file, body)


def _parts(source: str | Path, file: str | Path, name: str) -> tuple[Part, ...]:
    try:
        model = compiled_model(source)
    except ValueError as error:
        raise BadOption("parts", f"{file}: {' '.join(str(error).split())}") from None
    names = [model.body(each).name for each in range(1, model.nbody)]
    if not names or (name and name not in names):
        raise BadOption("parts", f"{file} has no body {name!r}; it has: {', '.join(names) or 'none'}")
    body = names.index(name) + 1 if name else 1
    welded = [int(each) for each in np.flatnonzero(model.body_weldid == model.body_weldid[body])]
    tree = [each for each in welded if each == body or _is_below(model, each, body)]
    solids = body_solids(model, body, solid_geoms(model, tree), names[body - 1])
    if not solids:
        raise BadOption("parts", f"{file}: body {names[body - 1]!r} has no geom that collides")
    return tuple(Part(each.shape, _triple(each.pose.position), _four(each.pose.quaternion)) for each in solids)


def _is_below(model: mujoco.MjModel, body: int, root: int) -> bool:
    while body > root:
        body = int(model.body_parentid[body])
    return body == root


def _triple(v: np.ndarray) -> tuple[float, float, float]:
    return float(v[0]), float(v[1]), float(v[2])


def _four(v: np.ndarray) -> tuple[float, float, float, float]:
    return float(v[0]), float(v[1]), float(v[2]), float(v[3])
