"""The body of an arm: capsules that contain its links and the objects it holds."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from ..errors import BadModel, BadShape, UnknownName
from ..geometry.capsule_cover import covering_capsules
from ..geometry.pose import Pose
from ..geometry.shapes import Shape
from .arm import Arm
from .kinematics import CHAIN

MAX_CAPSULES = 64


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


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Capsules that contain an arm's links, each moving with the frame of one joint (see `kinematics`).

    Attributes:
        rows: (m, 8): frame index (-1 for the fixed base, 0 to dof - 1), core end a (3) and b (3) in that frame
            [m], radius [m].
        names: (m,) part each capsule belongs to, like "link5"; several capsules may share a name.
        held: names of the held objects among them.

    Raises:
        BadModel: too many capsules, a frame no arm has, or implausible numbers.
        BadShape: rows that do not match the names.
    """

    rows: np.ndarray
    names: tuple[str, ...]
    held: tuple[str, ...] = field(default=())

    def __post_init__(self):
        rows = np.array(self.rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape != (len(self.names), BODY.width):
            raise BadShape("body: rows", rows.shape, f"({len(self.names)}, {BODY.width})")
        if len(rows) > MAX_CAPSULES:
            raise BadModel("body", "capsules", f"there are {len(rows)}; allowed are {MAX_CAPSULES}")
        for name, row in zip(self.names, rows, strict=True):
            if not np.isfinite(row).all() or np.abs(row[BODY.a :]).max() > 100.0 or not row[BODY.radius] > 0:
                raise BadModel("body", name, "a capsule has a number that is not finite, above 100 m, or no radius")
            if row[BODY.frame] != round(row[BODY.frame]) or row[BODY.frame] < -1:
                raise BadModel("body", name, f"frame {row[BODY.frame]:g} is not -1 or a joint's index")
        rows.flags.writeable = False
        object.__setattr__(self, "rows", rows)

    def __len__(self) -> int:
        """Number of capsules."""
        return len(self.rows)

    def holding(self, name: str, shape: Shape, tcp_from_object: Pose, arm: Arm) -> Body:
        """Return the body with an object in the hand, covered by capsules.

        Args:
            name: of the object, not yet in use.
            shape: of the object.
            tcp_from_object: pose of the object in the hand.
            arm: the arm this body belongs to.

        Raises:
            UnknownName: the name is in use.
        """
        if name in self.names:
            raise UnknownName("free name for a held object", name, ["any that is not in use"])
        last_from_object = last_from_tcp(arm) @ tcp_from_object
        rows = [
            np.concatenate([[arm.dof - 1.0], *(_moved(last_from_object, end) for end in capsule[:2]), [capsule[2]]])
            for capsule in covering_capsules(shape)
        ]
        return Body(np.vstack([self.rows, rows]), (*self.names, *[name] * len(rows)), (*self.held, name))

    def released(self) -> Body:
        """Return the body with an empty hand."""
        keep = [k for k, name in enumerate(self.names) if name not in self.held]
        return Body(self.rows[keep], tuple(self.names[k] for k in keep))

    def at_tool(self, arm: Arm) -> Body:
        """Return the part of the body that moves with the tcp: the hand and the objects it holds."""
        keep = np.flatnonzero(self.rows[:, BODY.frame] == arm.dof - 1)
        return Body(self.rows[keep], tuple(self.names[k] for k in keep), self.held)

    def tool(self, arm: Arm) -> np.ndarray:
        """Return the capsules (m', 7) that move with the tcp: core ends a, b in the tcp's frame [m], radius [m]."""
        tcp_from_last = last_from_tcp(arm).inverse()
        rows = self.rows[self.rows[:, BODY.frame] == arm.dof - 1]
        ends = [[_moved(tcp_from_last, row[k : k + 3]) for k in (BODY.a, BODY.b)] for row in rows]
        return np.column_stack([np.array(ends).reshape(-1, 6), rows[:, BODY.radius]])


def last_from_tcp(arm: Arm) -> Pose:
    """Return the pose of the tcp in the frame of the last joint."""
    row = arm.chain[-1]
    return Pose.from_position_quaternion(row[CHAIN.offset : CHAIN.kind], row[CHAIN.rotation : CHAIN.offset])


def _moved(a_from_b: Pose, point: np.ndarray) -> np.ndarray:
    return a_from_b.rotation @ point + a_from_b.position
