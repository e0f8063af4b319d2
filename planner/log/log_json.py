"""Arms, bodies, obstacles and poses as JSON, both ways.

Poses are unit dual quaternions (8 numbers, see `dualquat`), which JSON preserves bit by bit; infinite
joint limits are null.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from ..errors import OneDemoError
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Box, Capsule, Cylinder, Mesh, Obstacle, Shape, Sphere
from ..robot.arm import Arm
from ..robot.body import Body, Hull
from ..strict_json import Refused, list_of, number_of, numbers_of, table_of, text_of, texts_of

SHAPES: dict[str, type] = {"sphere": Sphere, "capsule": Capsule, "box": Box, "cylinder": Cylinder, "mesh": Mesh}
ROUND = ("radius", "length")
SIZES = {"sphere": ("radius",), "capsule": ROUND, "box": ("size",), "cylinder": ROUND, "mesh": ("vertices",)}
"""Size fields of a shape, by its kind."""


def content_of_arm(arm: Arm) -> dict[str, Any]:
    """Return an arm as JSON content."""
    return {
        "name": arm.name,
        "joint_names": list(arm.joint_names),
        "chain": arm.chain.tolist(),
        "lower": [value if math.isfinite(value) else None for value in arm.lower.tolist()],
        "upper": [value if math.isfinite(value) else None for value in arm.upper.tolist()],
        "velocity_limits": arm.velocity_limits.tolist(),
    }


def content_of_body(body: Body) -> dict[str, Any]:
    """Return a body as JSON content."""
    table: dict[str, Any] = {"rows": body.rows.tolist(), "names": list(body.names), "held": list(body.held)}
    if body.hulls:
        known = list({id(hull): hull for hull in body.hulls if hull is not None}.values())
        place = {id(hull): k for k, hull in enumerate(known)}
        table["hulls"] = [{"corners": np.asarray(h.corners).tolist(), "rounding": float(h.rounding)} for h in known]
        table["hull_of"] = [-1 if hull is None else place[id(hull)] for hull in body.hulls]
    if body.pairs is not None:
        table["pairs"] = [list(pair) for pair in body.pairs]
    if body.margins:
        table["margins"] = [[i, j, margin] for (i, j), margin in body.margins.items()]
    return table


@contextmanager
def _blaming(key: str) -> Iterator[None]:
    """Raise errors of the enclosed construction as errors of the given key."""
    try:
        yield
    except Refused:
        raise
    except OneDemoError as error:
        raise Refused(key, str(error)) from None


def pose_of(key: str, value: Any) -> Pose:
    """Parse a pose.

    Args:
        key: for messages.
        value: 8 numbers.

    Raises:
        Refused: anything else.
    """
    with _blaming(key):
        return Pose(numbers_of(key, value, (8,)))


def path_of(key: str, value: Any) -> PosePath:
    """Parse a path.

    Args:
        key: for messages.
        value: n lists of 8 numbers.

    Raises:
        Refused: anything else.
    """
    with _blaming(key):
        return PosePath(numbers_of(key, value, (None, 8)))


def arm_of(value: Any) -> Arm:
    """Parse an arm from its table.

    Raises:
        Refused: anything else.
    """
    table = table_of("arm", value, ("name", "joint_names", "chain", "lower", "upper", "velocity_limits"))
    names = texts_of("arm.joint_names", table["joint_names"])
    with _blaming("arm"):
        return Arm(
            text_of("arm.name", table["name"]),
            names,
            numbers_of("arm.chain", table["chain"], (len(names) + 1, 8)),
            _limits("arm.lower", table["lower"], -math.inf),
            _limits("arm.upper", table["upper"], math.inf),
            numbers_of("arm.velocity_limits", table["velocity_limits"], (len(names),)),
        )


def _limits(key: str, value: Any, absent: float) -> np.ndarray:
    limits = list_of(key, value)
    return np.array([absent if v is None else number_of(f"{key}[{k}]", v) for k, v in enumerate(limits)])


def body_of(value: Any) -> Body:
    """Parse a body from its table.

    Raises:
        Refused: anything else.
    """
    keys = [key for key in ("hulls", "hull_of", "pairs", "margins") if isinstance(value, dict) and key in value]
    table = table_of("body", value, ("rows", "names", "held", *keys))
    names = texts_of("body.names", table["names"])
    pairs = None
    if "pairs" in table:
        pairs = tuple((int(i), int(j)) for i, j in _whole("body.pairs", table["pairs"], (None, 2)))
    with _blaming("body"):
        return Body(
            numbers_of("body.rows", table["rows"], (None, 8)),
            names,
            texts_of("body.held", table["held"]),
            _hulls(table, len(names)),
            pairs,
            _margins(table),
        )


def _hulls(table: dict[str, Any], count: int) -> tuple[Hull | None, ...]:
    """The hulls of a body's capsules; () without any."""
    if "hulls" not in table and "hull_of" not in table:
        return ()
    known: list[Hull | None] = []
    for k, entry in enumerate(list_of("body.hulls", table.get("hulls"))):
        key = f"body.hulls[{k}]"
        hull = table_of(key, entry, ("corners", "rounding"))
        corners = numbers_of(f"{key}.corners", hull["corners"], (None, 3))
        known.append(Hull(corners, number_of(f"{key}.rounding", hull["rounding"])))
    places = _whole("body.hull_of", table.get("hull_of"), (count,))
    if len(places) and not (places.min() >= -1 and places.max() < len(known)):
        raise Refused("body.hull_of", f"holds a number that is not from -1 to {len(known) - 1}")
    return tuple([*known, None][k] for k in places)


def _margins(table: dict[str, Any]) -> dict[tuple[int, int], float]:
    """The margins of some pairs of a body's capsules; {} without any."""
    if "margins" not in table:
        return {}
    rows = numbers_of("body.margins", table["margins"], (None, 3))
    pairs = _whole("body.margins", rows[:, :2].tolist(), (None, 2))
    return {(int(i), int(j)): float(margin) for (i, j), margin in zip(pairs, rows[:, 2], strict=True)}


def _whole(key: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """Whole numbers of a shape."""
    numbers = numbers_of(key, value, shape)
    if (numbers != np.round(numbers)).any():
        raise Refused(key, "holds a number that is not whole")
    return numbers.astype(int)


def content_of_obstacle(obstacle: Obstacle) -> dict[str, Any]:
    """Return an obstacle as JSON content."""
    kind = next(kind for kind, shape in SHAPES.items() if isinstance(obstacle.shape, shape))
    sizes = {key: np.asarray(getattr(obstacle.shape, key)).tolist() for key in SIZES[kind]}
    return {
        "shape": {"kind": kind, **sizes},
        "pose": obstacle.pose.dq.tolist(),
        "velocity": obstacle.velocity.tolist(),
        "name": obstacle.name,
        "margin": None if obstacle.margin is None else float(obstacle.margin),
    }


def obstacle_of(key: str, value: Any) -> Obstacle:
    """Parse an obstacle.

    Args:
        key: for messages.
        value: table as written by `content_of_obstacle`.

    Raises:
        Refused: anything else.
    """
    table = table_of(key, value, ("shape", "pose", "velocity", "name", "margin"))
    margin = table["margin"]
    with _blaming(key):
        return Obstacle(
            _shape(f"{key}.shape", table["shape"]),
            pose_of(f"{key}.pose", table["pose"]),
            numbers_of(f"{key}.velocity", table["velocity"], (3,)),
            text_of(f"{key}.name", table["name"]),
            None if margin is None else number_of(f"{key}.margin", margin),
        )


def _shape(key: str, value: Any) -> Shape:
    kind = value.get("kind") if isinstance(value, dict) else None
    if not isinstance(kind, str) or kind not in SHAPES:
        raise Refused(f"{key}.kind", f"is {kind!r}; allowed: {', '.join(SHAPES)}")
    table = table_of(key, value, ("kind", *SIZES[kind]))
    with _blaming(key):
        if kind == "box":
            x, y, z = numbers_of(f"{key}.size", table["size"], (3,)).tolist()
            return Box((x, y, z))
        if kind == "mesh":
            return Mesh(numbers_of(f"{key}.vertices", table["vertices"], (None, 3)))
        return SHAPES[kind](*(number_of(f"{key}.{name}", table[name]) for name in SIZES[kind]))
