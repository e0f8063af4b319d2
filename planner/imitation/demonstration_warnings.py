"""Peculiarities of a demonstration that its user should know; none of them is an error."""

from __future__ import annotations

import numpy as np

from .demonstration import Demonstration
from .segmentation import dwells


def warnings_of(demonstration: Demonstration) -> list[str]:
    """List peculiarities of a demonstration to know before using it; none of them is an error."""
    found = []
    time, path = demonstration.time, demonstration.path
    for first, last in dwells(time, path):
        found.append(f"pause of {time[last] - time[first]:.1f} s from sample {first} to {last}")
    steps = np.diff(path.lengths())
    repeated = int((steps < 2e-4).sum())
    if repeated > 0.05 * len(steps):
        found.append(f"{repeated} of {len(steps)} steps are shorter than 0.2 mm: pauses or repeated samples")
    intervals = np.diff(time)
    if intervals.max() > 1.5 * np.median(intervals):
        found.append(f"time steps vary from {intervals.min() * 1e3:.0f} to {intervals.max() * 1e3:.0f} ms")
    if not demonstration.segments:
        found.append("no segments: neither gripper events nor pauses were found")
    for segment in demonstration.segments:
        pose = path[segment.stop]
        down = np.degrees(np.arccos(np.clip(-pose.rotation[2, 2], -1.0, 1.0)))
        if segment.gripper != "none" and 2.0 < down < 45.0:
            found.append(f"the tool is tilted by {down:.1f} deg at the end of {segment.name!r}: imitated as it is")
    return found
