"""The body of an arm: capsules, and convex hulls in them, that contain its links and the objects it holds."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np

from ..arrays import FrozenArrays, checked_array, checked_items, checked_kind, frozen, numbers
from ..errors import BadModel, BadOption, BadShape, UnknownName, WrongType
from ..geometry.capsule_cover import covering_capsules
from ..geometry.pose import Pose
from ..geometry.shapes import MAX_VERTICES, Obstacle, Shape
from .arm import Arm
from .kinematics import CHAIN

MAX_CAPSULES = 64
"""Largest number of capsules of a robot, all arms together: every query visits all of them."""


class BodyColumns(NamedTuple):
    """Columns of a capsule of a body, in the frame that it moves with."""

    frame: int = 0  # joint whose frame it moves with; -1: the fixed base
    a: int = 1  # one end of the core (3) [m]
    b: int = 4  # the other end (3) [m]
    radius: int = 7  # [m]
    width: int = 8


class ToolCapsuleColumns(NamedTuple):
    """Columns of a capsule of a tool, in the frame of the tcp."""

    a: int = 0  # one end of the core (3) [m]
    b: int = 3  # the other end (3) [m]
    radius: int = 6  # [m]
    width: int = 7


BODY, TOOL_CAPSULE = BodyColumns(), ToolCapsuleColumns()


class Hull(NamedTuple):
    """A convex piece of a robot: all points within `rounding` of the hull of some corners.

    Attributes:
        corners: (n, 3) in the frame of the capsules that cover the piece [m].
        rounding: [m].
    """

    corners: np.ndarray
    rounding: float = 0.0

    def moved(self, a_from_b: Pose) -> Hull:
        """Return the piece, given in frame b, in frame a."""
        return Hull(self.corners @ a_from_b.rotation.T + a_from_b.position, self.rounding)


@dataclass(frozen=True, slots=True, eq=False)
class Body(FrozenArrays):
    """Capsules that contain an arm's links, each moving with the frame of one joint (see `kinematics`).

    Attributes:
        rows: (m, 8): frame index (-1 for the fixed base, 0 to dof - 1), core end a (3) and b (3) in that frame
            [m], radius [m].
        names: (m,) part each capsule belongs to, like "link5"; several capsules may share a name.
        held: names of the held objects among them.
        hulls: (m,) convex piece that contains what the capsule covers, in the capsule's frame, or None; several
            capsules may cover one piece. Where a capsule is close to something, the piece decides. (): no pieces.
        pairs: pairs (i, j), i < j, of capsules that can hit each other; the others always touch, or never can. None:
            unknown, see `self_collision.body_pairs`.
        margins: most [m] that some of the pairs are asked to keep between them, since they pass closer by each other
            than a usual margin in ordinary postures.

    Raises:
        BadModel: too many capsules, a frame no arm has, or implausible numbers.
        BadShape: rows, hulls or pairs that do not match the names.
    """

    rows: np.ndarray
    names: tuple[str, ...]
    held: tuple[str, ...] = field(default=())
    hulls: tuple[Hull | None, ...] = field(default=())
    pairs: tuple[tuple[int, int], ...] | None = field(default=None)
    margins: Mapping[tuple[int, int], float] = field(default_factory=dict)

    def __post_init__(self):
        rows = frozen(numbers("body: rows", self.rows))
        object.__setattr__(self, "names", checked_items("body: names", self.names, str))
        if rows.ndim != 2 or rows.shape != (len(self.names), BODY.width):
            raise BadShape("body: rows", rows.shape, f"({len(self.names)}, {BODY.width})")
        if len(rows) > MAX_CAPSULES:
            raise BadModel("body", "capsules", f"there are {len(rows)}; allowed are {MAX_CAPSULES}")
        for name, row in zip(self.names, rows, strict=True):
            if not np.isfinite(row).all() or np.abs(row[BODY.a :]).max() > 100.0 or not row[BODY.radius] > 0:
                raise BadModel("body", name, "a capsule has a number that is not finite, above 100 m, or no radius")
            if row[BODY.frame] != round(row[BODY.frame]) or row[BODY.frame] < -1:
                raise BadModel("body", name, f"frame {row[BODY.frame]:g} is not -1 or a joint's index")
        object.__setattr__(self, "rows", rows)
        if self.hulls:
            self._check_hulls()
        if self.pairs is not None and len(self.pairs):
            pairs = checked_array("body: pairs", self.pairs, (None, 2))
            for k, (i, j) in enumerate(pairs):
                if not 0 <= i < j < len(rows) or i != int(i) or j != int(j):
                    reason = f"({i:g}, {j:g}) is not (i, j) with whole numbers 0 <= i < j < {len(rows)}"
                    raise BadModel("body", f"pairs[{k}]", reason)
            object.__setattr__(self, "pairs", tuple((int(i), int(j)) for i, j in pairs))
        margins = checked_kind("body: margins", self.margins, Mapping)
        values = checked_array("body: margins", list(margins.values()), (None,), finite=False)
        for pair, margin in zip(margins, values, strict=True):
            if pair not in (self.pairs or ()) or not 0.0 <= margin <= 100.0:
                raise BadModel("body", "margins", f"{pair}: {margin:g} is no length from 0 to 100 m of a known pair")
        object.__setattr__(self, "margins", dict(zip(margins, values.tolist(), strict=True)))

    def _check_hulls(self) -> None:
        if len(self.hulls) != len(self.rows):
            raise BadShape("body: hulls", (len(self.hulls),), f"({len(self.rows)},)")
        kept: dict[int, Hull] = {}  # capsules that share a hull go on sharing it
        for name, hull in zip(self.names, self.hulls, strict=True):
            if hull is None or id(hull) in kept:
                continue
            label = f"body: hull of {name}"
            corners = frozen(numbers(label, checked_kind(label, hull, Hull).corners))
            if corners.ndim != 2 or corners.shape[1] != 3 or not 1 <= len(corners) <= MAX_VERTICES:
                raise BadShape(label, corners.shape, f"(n, 3), n from 1 to {MAX_VERTICES}")
            if not (np.abs(corners) <= 100.0).all() or not 0.0 <= hull.rounding <= 100.0:
                raise BadModel("body", name, "a hull has a number that is not finite or above 100 m")
            kept[id(hull)] = Hull(corners, float(hull.rounding))
        hulls = tuple(None if hull is None else kept[id(hull)] for hull in self.hulls)
        object.__setattr__(self, "hulls", hulls)

    def __len__(self) -> int:
        """Number of capsules."""
        return len(self.rows)

    def holding(self, name: str, shape: Shape | Sequence[Obstacle], tcp_from_object: Pose, arm: Arm) -> Body:
        """Return the body with an object in the hand, covered by capsules.

        Args:
            name: of the object, not yet in use.
            shape: of the object; or the convex solids that it consists of, with their poses in the object's frame.
            tcp_from_object: pose of the object in the hand.
            arm: the arm this body belongs to.

        Raises:
            WrongType: an argument is of a wrong class.
            UnknownName: the name is in use.
        """
        checked_kind("name", name, str)
        solids = [Obstacle(shape)] if isinstance(shape, Shape) else _checked_solids(shape)
        checked_kind("tcp_from_object", tcp_from_object, Pose)
        checked_kind("arm", arm, Arm)
        if name in self.names:
            raise UnknownName("free name for a held object", name, ["any that is not in use"])
        last_from_object = last_from_tcp(arm) @ tcp_from_object
        rows = [
            np.concatenate([[arm.dof - 1.0], *(_moved(last_from_solid, end) for end in capsule[:2]), [capsule[2]]])
            for solid in solids
            for last_from_solid in [last_from_object @ solid.pose]
            for capsule in covering_capsules(solid.shape)
        ]
        hulls = (*self.hulls, *[None] * len(rows)) if self.hulls else ()
        names = (*self.names, *[name] * len(rows))
        pairs = self.pairs
        if pairs is not None:  # what is held touches the hand, and hangs before the link that carries the hand
            others = np.flatnonzero(self.rows[:, BODY.frame] < arm.dof - 2)
            pairs = (*pairs, *((int(i), len(self) + k) for i in others for k in range(len(rows))))
        return Body(np.vstack([self.rows, rows]), names, (*self.held, name), hulls, pairs, self.margins)

    def released(self) -> Body:
        """Return the body with an empty hand."""
        return self._part([k for k, name in enumerate(self.names) if name not in self.held], ())

    def at_tool(self, arm: Arm) -> Body:
        """Return the part of the body that moves with the tcp: the hand and the objects it holds."""
        return self._part(np.flatnonzero(self.rows[:, BODY.frame] == arm.dof - 1), self.held)

    def moving(self) -> Body:
        """Return the body without its fixed base."""
        return self._part(np.flatnonzero(self.rows[:, BODY.frame] >= 0), self.held)

    def with_base_moved(self, by: np.ndarray) -> Body:
        """Return the body of a robot that stands elsewhere: its fixed base is displaced.

        Args:
            by: (3,) displacement of the base [m].

        Raises:
            BadShape: it is no such vector.
        """
        by = checked_array("by", by, (3,))
        fixed, moved = self.rows[:, BODY.frame] < 0, {}
        rows = self.rows.copy()
        for column in (BODY.a, BODY.b):
            rows[fixed, column : column + 3] += by
        for k in np.flatnonzero(fixed) if self.hulls else ():
            hull = self.hulls[k]
            if hull is not None and id(hull) not in moved:  # capsules that share a hull go on sharing it
                moved[id(hull)] = hull.moved(Pose.from_position_quaternion(by))
        hulls = tuple(
            moved.get(id(hull), hull) if base else hull for hull, base in zip(self.hulls, fixed, strict=False)
        )
        return replace(self, rows=rows, hulls=hulls)

    def _part(self, keep: Sequence[int] | np.ndarray, held: tuple[str, ...]) -> Body:
        names = tuple(self.names[k] for k in keep)
        hulls = tuple(self.hulls[k] for k in keep) if self.hulls else ()
        place, pairs = {int(old): new for new, old in enumerate(keep)}, self.pairs
        if pairs is not None:
            pairs = tuple((place[i], place[j]) for i, j in pairs if i in place and j in place)
        margins = {(place[i], place[j]): m for (i, j), m in self.margins.items() if i in place and j in place}
        return Body(self.rows[np.asarray(keep, dtype=int)], names, held, hulls, pairs, margins)

    def ignoring(self, *names: tuple[str, str]) -> Body:
        """Return the body without the checks of some pairs of parts against each other.

        Args:
            *names: pairs of names of parts.

        Raises:
            UnknownName: a part that does not exist.
            BadOption: it is unknown which pairs of this body can hit each other.
        """
        for name in (name for pair in names for name in pair):
            if name not in self.names:
                raise UnknownName("part of the body", name, dict.fromkeys(self.names))
        if self.pairs is None:
            raise BadOption("ignore", "of this body it is unknown which pairs can hit each other")
        wanted = {frozenset(pair) for pair in names}
        pairs = tuple(pair for pair in self.pairs if frozenset(self.names[k] for k in pair) not in wanted)
        return replace(self, pairs=pairs, margins={pair: m for pair, m in self.margins.items() if pair in pairs})

    def tool(self, arm: Arm) -> np.ndarray:
        """Return the capsules (m', 7) that move with the tcp: core ends a, b in the tcp's frame [m], radius [m]."""
        tcp_from_last = last_from_tcp(arm).inverse()
        rows = self.rows[self.rows[:, BODY.frame] == arm.dof - 1]
        ends = [[_moved(tcp_from_last, row[k : k + 3]) for k in (BODY.a, BODY.b)] for row in rows]
        return np.column_stack([np.array(ends).reshape(-1, 6), rows[:, BODY.radius]])

    def tool_hulls(self, arm: Arm) -> tuple[Hull | None, ...]:
        """Return the hulls, in the tcp's frame, of the capsules of `tool`; () without any."""
        if not self.hulls:
            return ()
        tcp_from_last, moved = last_from_tcp(arm).inverse(), {}
        mine = [self.hulls[k] for k in np.flatnonzero(self.rows[:, BODY.frame] == arm.dof - 1)]
        for hull in mine:  # capsules that share a hull go on sharing it
            if hull is not None and id(hull) not in moved:
                moved[id(hull)] = hull.moved(tcp_from_last)
        return tuple(None if hull is None else moved[id(hull)] for hull in mine)


def _checked_solids(solids: Sequence[Obstacle]) -> tuple[Obstacle, ...]:
    """Return the solids of a held object.

    Raises:
        WrongType: what is given is neither a shape nor a sequence of solids.
    """
    if not isinstance(solids, Sequence) or not solids or not all(isinstance(each, Obstacle) for each in solids):
        raise WrongType("shape", solids, "a Sphere, Capsule, Box, Cylinder or Mesh, or a sequence of obstacles")
    return tuple(solids)


def last_from_tcp(arm: Arm) -> Pose:
    """Return the pose of the tcp in the frame of the last joint."""
    row = arm.chain[-1]
    return Pose.from_position_quaternion(row[CHAIN.offset : CHAIN.kind], row[CHAIN.rotation : CHAIN.offset])


def _moved(a_from_b: Pose, point: np.ndarray) -> np.ndarray:
    return a_from_b.rotation @ point + a_from_b.position
