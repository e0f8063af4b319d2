"""Contents of a recording, whatever file it was in, in one frame and in meters, seconds and radians."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..errors import BadDemonstration
from ..geometry.pose import Pose, PosePath

METERS = {"m": 1.0, "cm": 0.01, "mm": 0.001}
SECONDS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
RADIANS = {"rad": 1.0, "deg": np.pi / 180.0}
QUATERNIONS = {"wxyz": (0, 1, 2, 3), "xyzw": (3, 0, 1, 2)}
"""For each order of a quaternion's columns the columns of w, x, y, z."""

Blame = Callable[[str], BadDemonstration]
"""Makes the error about a file and a key from its reason."""


def blame_of(file: Path, key: str) -> Blame:
    """Return what makes errors about a key of a file.

    Args:
        file: the file.
        key: its key.
    """
    return lambda reason: BadDemonstration(file, key, reason)


@dataclass(frozen=True, slots=True, eq=False)
class Recording:
    """A recording of one motion of a hand.

    Attributes:
        file: it was read from, for messages.
        time: (n,) [s].
        hand: n poses of the tcp.
        tcp_frame: name of the frame that was recorded.
        joints: (n, dof) of the arm [rad or m]; None if not recorded.
        other_joints: (n,) positions of each other joint [rad or m].
        gripper: (n,) command, 1 closes and -1 opens; None if not recorded.
        objects: n poses of each object that was recorded.
        fixtures: pose of each thing that stood still.
        commanded: n poses that the tcp was sent to; None if not recorded.
        is_computed: the hand's poses were not recorded, but computed from the joints.
        notes: what was understood of the file, decided or left out, a line each.
    """

    file: Path
    time: np.ndarray
    hand: PosePath
    tcp_frame: str = "tool"
    joints: np.ndarray | None = None
    other_joints: Mapping[str, np.ndarray] = field(default_factory=dict)
    gripper: np.ndarray | None = None
    objects: Mapping[str, PosePath] = field(default_factory=dict)
    fixtures: Mapping[str, Pose] = field(default_factory=dict)
    commanded: PosePath | None = None
    is_computed: bool = False
    notes: tuple[str, ...] = ()
