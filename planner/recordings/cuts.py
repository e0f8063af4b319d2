"""Motions of a recording: cut where the gripper acts or the hand rests, or as its user says."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration, BadOption, UnknownName
from ..geometry.pose import Pose
from ..imitation.demonstration import GRIPPER_ACTIONS, Segment
from ..imitation.segmentation import dwells, gripper_events
from .recording import Recording

CUTS = ("auto", "gripper", "rests", "none")
"""Where motions end: "auto" is "gripper" if it acts at all, else "rests"."""
REST = 0.005
"""Path length [m] below which a piece of a recording counts as standing still."""
LEAVING = 0.05
"""Path length [m] from which what follows the last action of the gripper is a motion of its own."""
HOLDS = 0.15
"""Largest distance [m] of the tcp from the origin of an object that it takes."""

CARRYING = ("carry", "transfer", "insert")
"""Motions of tasks that have something in the hand, so that they do not end with a grasp."""


class SegmentRequest(NamedTuple):
    """Wishes of a user about a motion; None is found from the recording.

    Attributes:
        name: of the motion.
        start: first sample, or time [s] since the first sample if it is a float.
        stop: last sample, or time, likewise.
        reference: object or fixture that its end is relative to, "" for the world.
        held: object in the hand, "" if none.
        gripper: action of the gripper at its end.
    """

    name: str
    start: int | float | None = None
    stop: int | float | None = None
    reference: str | None = None
    held: str | None = None
    gripper: str | None = None


def parsed_segment(text: str) -> SegmentRequest:
    """Return the request of a text like "transfer=3.2s:8s,reference=plate,held=cup,gripper=open".

    Raises:
        BadOption: another form; the error shows the right one.
    """
    head, *options = text.split(",")
    name, _, window = head.partition("=")
    if not name.strip():
        raise BadOption("segment", f"{text!r} does not begin with a name, like approach or approach=0s:3.5s")
    values: dict[str, str] = {}
    for option in options:
        key, given, value = option.partition("=")
        if key.strip() not in ("reference", "held", "gripper") or not given:
            raise BadOption("segment", f"{option!r} of {text!r} is none of reference=NAME, held=NAME, gripper=ACTION")
        values[key.strip()] = value.strip()
    if "gripper" in values and values["gripper"] not in GRIPPER_ACTIONS:
        raise BadOption("segment", f"gripper {values['gripper']!r} of {text!r} is none of {', '.join(GRIPPER_ACTIONS)}")
    start = stop = None
    if window:
        found = re.fullmatch(r"\s*([\d.]+)(s?)\s*:\s*([\d.]+)(s?)\s*", window)
        try:
            ends = [] if found is None else [_moment(found[1], found[2]), _moment(found[3], found[4])]
        except ValueError:
            ends = []
        if not ends:
            raise BadOption("segment", f"{window!r} of {text!r} is no range of samples, 0:169, or of seconds, 0s:8.4s")
        start, stop = ends
    return SegmentRequest(name.strip(), start, stop, **values)


def _moment(number: str, seconds: str) -> int | float:
    return float(number) if seconds else int(number)


def segments_of(
    recording: Recording, requests: Sequence[SegmentRequest] = (), names: Sequence[str] = (), cut: str = "auto"
) -> tuple[Segment, ...]:
    """Return the motions of a recording.

    Args:
        recording: the recording.
        requests: of its user; without ranges they are for the motions that are found, in order.
        names: of the motions that a task needs, for those that no request names.
        cut: where motions end, see `CUTS`.

    Raises:
        UnknownName: an unknown way to cut, object or fixture.
        BadDemonstration: requests or names for more motions than there are.
    """
    if cut not in CUTS:
        raise UnknownName("cut", cut, CUTS)
    pieces = _pieces(recording, cut)
    ranges = [_range(recording, request) for request in requests]
    whole = all(ends is not None for ends in ranges)
    if requests and not whole and len(requests) > len(pieces):
        raise BadDemonstration(recording.file, "segments", f"{len(requests)} are named; {_found(recording, pieces)}")
    if not requests and names:
        if not _serves(recording, pieces, len(names)) or _ends_with_grasp(recording, pieces, names):
            wanted = f"the task needs {', '.join(names)}; {_found(recording, pieces)}"
            example = (
                f"--segment {names[0]}=0s:{recording.time[pieces[0][1]] - recording.time[0] if pieces else 1:.1f}s"
            )
            raise BadDemonstration(recording.file, "segments", f"{wanted}: name them, like {example}")
        requests, ranges = [SegmentRequest(name) for name in names], [None] * len(names)
    if not requests:
        requests = [SegmentRequest(f"motion{k + 1}") for k in range(len(pieces))]
        ranges = [None] * len(pieces)
    ends = [found or pieces[k] for k, found in enumerate(ranges)]
    segments, held = [], ""
    for request, (start, stop) in zip(requests, ends, strict=True):
        segment = _segment(recording, request, start, stop, held)
        held = {"close": segment.reference, "open": "", "none": segment.held}[segment.gripper]
        segments.append(segment)
    return tuple(segments)


def _serves(recording: Recording, pieces: list[tuple[int, int]], count: int) -> bool:
    """Return whether so many motions are found; one more may be the hand's way home after its last release."""
    leaves = len(pieces) == count + 1 and count > 0 and _action(recording, pieces[count - 1][1]) == "open"
    return len(pieces) == count or leaves


def _ends_with_grasp(recording: Recording, pieces: list[tuple[int, int]], names: Sequence[str]) -> bool:
    """Return whether a motion that carries something by its name would end with the grasp."""
    carried = [piece for name, piece in zip(names, pieces, strict=False) if name in CARRYING]
    return any(_action(recording, stop) == "close" for _, stop in carried)


def _found(recording: Recording, pieces: list[tuple[int, int]]) -> str:
    start = recording.time[0]
    ends = {"close": ", then the gripper closes", "open": ", then it opens", "none": ""}
    spans = [
        f"{recording.time[a] - start:.1f} to {recording.time[b] - start:.1f} s{ends[_action(recording, b)]}"
        for a, b in pieces
    ]
    return f"found {'is' if len(spans) == 1 else 'are'} {len(spans)} motion{'s'[: len(spans) != 1]}" + (
        f" ({'; '.join(spans)})" if spans else ""
    )


def _range(recording: Recording, request: SegmentRequest) -> tuple[int, int] | None:
    """Return the samples of a request; None if it gives none."""
    if request.start is None or request.stop is None:
        return None
    since = recording.time - recording.time[0]
    ends = []
    for value in (request.start, request.stop):
        if isinstance(value, float):
            if value > since[-1] + 0.5 * float(np.median(np.diff(since))):
                reason = f"ends at {value:g} s; the recording lasts {since[-1]:.4g} s"
                raise BadDemonstration(recording.file, f"segment {request.name!r}", reason)
            value = int(np.abs(since - value).argmin())
        ends.append(value)
    return ends[0], ends[1]


def _pieces(recording: Recording, cut: str) -> list[tuple[int, int]]:
    """Return the first and the last sample of each motion."""
    events = [] if recording.gripper is None else [int(each) for each in gripper_events(recording.gripper)]
    last = len(recording.time) - 1
    if cut == "none":
        return [(0, last)]
    if cut == "gripper" or (cut == "auto" and events):
        starts = [0, *(event + 1 for event in events)]
        pieces = [(start, stop) for start, stop in zip(starts, events, strict=False) if stop > start]
        lengths = recording.hand.lengths()
        if starts[-1] < last and lengths[last] - lengths[starts[-1]] > LEAVING:
            pieces.append((starts[-1], last))
        return pieces
    return moving_pieces(recording)


def moving_pieces(recording: Recording) -> list[tuple[int, int]]:
    """Return the sample ranges between rests, without those that stand still."""
    edges = [0, *(edge for rest in dwells(recording.time, recording.hand) for edge in rest), len(recording.time) - 1]
    lengths = recording.hand.lengths()
    pairs = zip(edges[::2], edges[1::2], strict=True)
    return [(a, b) for a, b in pairs if b > a and lengths[b] - lengths[a] > REST]


def _segment(recording: Recording, request: SegmentRequest, start: int, stop: int, held: str) -> Segment:
    gripper = _action(recording, stop) if request.gripper is None else request.gripper
    held = held if request.held is None else request.held
    last = min(max(stop, 0), len(recording.time) - 1)
    places = {name: path[last] for name, path in recording.objects.items()} | dict(recording.fixtures)
    for role, name in (("reference", request.reference or ""), ("held", held)):
        if name and places and name not in places:
            raise UnknownName(f"{role} of segment {request.name!r}", name, places)
    reference = _likely(recording, places, last, held, gripper) if request.reference is None else request.reference
    return Segment(request.name, start, stop, reference, places.get(reference, Pose.identity()), held, gripper)


def _action(recording: Recording, stop: int) -> str:
    """Return what the gripper does right after a sample."""
    gripper = recording.gripper
    if gripper is None or not 0 <= stop < len(gripper) - 1 or gripper[stop] == gripper[stop + 1]:
        return "none"
    return "close" if gripper[stop + 1] > 0.0 else "open"


def _likely(recording: Recording, places: dict[str, Pose], last: int, held: str, gripper: str) -> str:
    """Return the object that a motion probably goes to: the nearest one to what moves, if it is near; else ""."""
    others = {
        name: pose
        for name, pose in places.items()
        if name != held and (gripper != "close" or name in recording.objects)
    }
    if gripper == "none" or not others or (gripper == "open" and not held):
        return ""
    moved = recording.hand[last] if gripper == "close" else places.get(held, recording.hand[last])
    gaps = {name: float(np.linalg.norm(pose.position - moved.position)) for name, pose in others.items()}
    nearest = min(gaps, key=lambda name: gaps[name])
    return nearest if gaps[nearest] < HOLDS else ""
