"""Positions of beads at rest in a glass: settled once by the physics, precomputed and shipped as a table."""

from __future__ import annotations

import json
import math
from functools import cache
from pathlib import Path
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from ...planner import Pose
from ...planner.errors import UnknownName
from ..mujoco_library import compiled_model, mujoco
from .mjcf_parts import bead_bodies, glass_body
from .scene_objects import Beads, Glass

TABLE = Path(__file__).parents[1] / "assets" / "beads.json"
DIGITS = 6
"""Number of decimals of the shipped positions [m]."""
SECONDS, DAMPING = 8.0, 0.002
"""Duration of settling [s], and damping of a bead meanwhile [N s/m]: twenty times its damping in a scene."""


def label(glass: Glass, beads: Beads) -> str:
    """Return a filling's key in the table: everything on which the arrangement depends.

    Args:
        glass: glass to fill.
        beads: beads to fill in.
    """
    return f"{beads.count} of {1e3 * beads.radius:g} mm in {1e3 * (glass.radius - glass.wall):g} mm"


@cache
def settled_beads(glass: Glass, beads: Beads) -> np.ndarray:
    """Return the positions (n, 3) [m] of beads at rest in an upright glass, in its frame; read-only.

    Args:
        glass: filled glass.
        beads: beads in it.

    Raises:
        UnknownName: the table lacks this filling; `make beads` rewrites the table.
    """
    table = json.loads(TABLE.read_text(encoding="utf-8"))
    key = label(glass, beads)
    if key not in table:
        raise UnknownName("filling of a glass", key, table)
    places = np.array(table[key])
    # the table counts heights from the inner bottom, so that it serves glasses of any height
    places[:, 2] += glass.wall - 0.5 * glass.height
    places.flags.writeable = False
    return places


def poured_into(pose: np.ndarray, glass: Glass, beads: Beads) -> np.ndarray:
    """Return the world positions (n, 3) [m] of beads at rest in a glass.

    Args:
        pose: (7,) pose of the glass, x y z [m] and wxyz.
        glass: filled glass.
        beads: beads in it.
    """
    frame = Pose.from_vector(pose)
    return frame.position + settled_beads(glass, beads) @ frame.rotation.T


def settling(glass: Glass, beads: Beads) -> np.ndarray:
    """Simulate beads that fall into a glass; return their positions (n, 3) [m], heights from its inner bottom.

    Args:
        glass: glass to fill.
        beads: beads to fill in.
    """
    root = Element("mujoco")
    SubElement(root, "option", {"cone": "elliptic", "impratio": "20", "timestep": "0.002"})
    world = SubElement(root, "worldbody")
    cup = glass_body(glass)
    cup.remove(next(cup.iter("joint")))
    world.append(cup)
    world.extend(bead_bodies(beads))
    for joint in world.iter("joint"):
        joint.set("damping", f"{DAMPING}")
    model = compiled_model(tostring(root, encoding="unicode"))
    data = mujoco.MjData(model)
    data.qpos[:] = _heap(glass, beads).ravel()
    mujoco.mj_step(model, data, round(SECONDS / model.opt.timestep))
    places = data.qpos.reshape(-1, 3).copy()
    places[:, 2] -= glass.wall - 0.5 * glass.height
    return np.round(places, DIGITS)


def _heap(glass: Glass, beads: Beads) -> np.ndarray:
    """Return initial positions (n, 3) [m] in layers, in which no two beads touch."""
    room, pitch = glass.radius - glass.wall - 1.2 * beads.radius, 2.1 * beads.radius
    steps = np.arange(-10, 11) * pitch
    ring = np.array([(x, y) for x in steps for y in steps if math.hypot(x, y) <= room])
    layer, spot = np.divmod(np.arange(beads.count), len(ring))
    height = glass.wall - 0.5 * glass.height + 1.1 * beads.radius + pitch * layer
    # beads exactly above each other would balance
    rng = np.random.default_rng(0)
    askew = 0.02 * beads.radius * rng.uniform(-1.0, 1.0, (beads.count, 2))
    return np.column_stack([ring[spot] + askew, height])


def table_text(fillings: tuple[tuple[Glass, Beads], ...]) -> str:
    """Settle the given fillings anew; return the text of the shipped table, written by `make beads`."""
    return json.dumps({label(*each): settling(*each).tolist() for each in fillings}, indent=1) + "\n"
