"""A demonstration from a recording."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import BadDemonstration
from ..imitation.demonstration import Demonstration
from .cuts import SegmentRequest, segments_of
from .recording import Recording


def demonstration_of(
    recording: Recording,
    *,
    name: str,
    task: str = "",
    robot: str = "Panda",
    source: str = "teleoperated",
    licence: str = "unknown",
    requests: Sequence[SegmentRequest] = (),
    names: Sequence[str] = (),
    cut: str = "auto",
    sizes: Mapping[str, np.ndarray] | None = None,
) -> Demonstration:
    """Return the demonstration of a recording; all that was recorded is kept.

    Args:
        recording: the recording.
        name: of the demonstration.
        task: that was demonstrated, "" if none.
        robot: that was recorded.
        source: "teleoperated", "kinesthetic" or "scripted".
        licence: of the data.
        requests: what its user says of its motions.
        names: of the motions that the task needs.
        cut: where motions end, see `cuts.CUTS`.
        sizes: full extents (3,) [m] of objects.

    Raises:
        UnknownName, BadDemonstration: see `segments_of`; or the demonstration is invalid.
    """
    try:
        return Demonstration(
            name=name,
            task=task,
            robot=robot,
            tcp_frame=recording.tcp_frame,
            source=source,
            licence=licence,
            time=recording.time,
            path=recording.hand,
            joint_positions=recording.joints,
            gripper=recording.gripper,
            segments=segments_of(recording, requests, names, cut),
            object_sizes=dict(sizes or {}),
            object_paths=recording.objects,
            fixtures=recording.fixtures,
            other_joints=recording.other_joints,
            commanded=recording.commanded,
        )
    except BadDemonstration as error:
        raise BadDemonstration(recording.file, error.key, error.reason) from None
