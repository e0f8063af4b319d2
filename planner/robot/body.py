"""The body of an arm: capsules on its links that contain them, and whatever it holds."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from ..errors import BadModel, BadShape, UnknownName
from ..geometry.capsule_cover import covering_capsules
from ..geometry.pose import Pose
from ..geometry.shapes import Shape
from .arm import Arm

MAX_CAPSULES = 64
FRAME, A, B, RADIUS, WIDTH = 0, 1, 4, 7, 8
"""Columns of a row: frame that it moves with (-1: the base), ends of the core in that frame, radius [m]."""


@dataclass(frozen=True, slots=True, eq=False)
class Body:
    """Capsules, each moving with one joint's frame (see `chain`), that contain an arm's links.

    Attributes:
        rows: (m, 8): frame index (-1 for the fixed base, 0 to dof - 1), core end a (3) and b (3) in that frame
            [m], radius [m].
        names: (m,) whose capsule it is, like "link5"; several may share a name.
        held: names of held objects among them.

    Raises:
        BadModel: a frame that no arm has, or numbers that are absurd.
    """

    rows: np.ndarray
    names: tuple[str, ...]
    held: tuple[str, ...] = field(default=())

    def __post_init__(self):
        rows = np.array(self.rows, dtype=np.float64)
        if rows.ndim != 2 or rows.shape != (len(self.names), WIDTH):
            raise BadShape("body: rows", rows.shape, f"({len(self.names)}, {WIDTH})")
        if len(rows) > MAX_CAPSULES:
            raise BadModel("body", "capsules", f"there are {len(rows)}; allowed are {MAX_CAPSULES}")
        for name, row in zip(self.names, rows, strict=True):
            if not np.isfinite(row).all() or np.abs(row[A:]).max() > 100.0 or not row[RADIUS] > 0:
                raise BadModel("body", name, "a capsule has a number that is not finite, above 100 m, or no radius")
            if row[FRAME] != round(row[FRAME]) or row[FRAME] < -1:
                raise BadModel("body", name, f"frame {row[FRAME]:g} is not -1 or a joint's index")
        rows.flags.writeable = False
        object.__setattr__(self, "rows", rows)

    def __len__(self) -> int:
        """Number of capsules."""
        return len(self.rows)

    def holding(self, name: str, shape: Shape, tcp_from_object: Pose, arm: Arm) -> Body:
        """The body with an object in the hand, covered by capsules.

        Args:
            name: of the object.
            shape: its form.
            tcp_from_object: where it is in the hand.
            arm: the arm that this body belongs to.
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
        """The body with an empty hand."""
        keep = [k for k, name in enumerate(self.names) if name not in self.held]
        return Body(self.rows[keep], tuple(self.names[k] for k in keep))

    def at_tool(self, arm: Arm) -> Body:
        """Only what moves with the tcp: the hand and what it holds."""
        keep = np.flatnonzero(self.rows[:, FRAME] == arm.dof - 1)
        return Body(self.rows[keep], tuple(self.names[k] for k in keep), self.held)

    def tool(self, arm: Arm) -> np.ndarray:
        """(m', 7) capsules that move with the tcp: core ends a, b in the tcp's frame, radius [m]."""
        tcp_from_last = last_from_tcp(arm).inverse()
        rows = self.rows[self.rows[:, FRAME] == arm.dof - 1]
        ends = [np.concatenate([_moved(tcp_from_last, r[A:B]), _moved(tcp_from_last, r[B:RADIUS])]) for r in rows]
        return np.column_stack([np.array(ends).reshape(-1, 6), rows[:, RADIUS]])


def last_from_tcp(arm: Arm) -> Pose:
    """The tcp in the last joint's frame."""
    row = arm.chain[-1]
    return Pose.from_position_quaternion(row[4:7], row[:4])


def _moved(a_from_b: Pose, point: np.ndarray) -> np.ndarray:
    return a_from_b.rotation @ point + a_from_b.position
