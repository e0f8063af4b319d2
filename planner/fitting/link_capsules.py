"""The body of a robot: capsules, and hulls in them, that contain its parts.

Parts attached by joints that are not the arm's, like a gripper's fingers, are covered over the whole range of those
joints.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..errors import BadModel, UnfitShape, UnknownName
from ..geometry.capsule_cover import fitted_capsules, rough_capsule, strips
from ..geometry.convex_pieces import rounded_hull
from ..geometry.hulls import Cover, sticks_out, union_volume
from ..geometry.pose import Pose
from ..geometry.shapes import hull_corners
from ..robot.arm import Arm
from ..robot.body import MAX_CAPSULES, Body, Hull
from ..robot.joint_frames import joint_frames, moved
from .link_pieces import FLAT, Piece, convex_link_pieces, whole_pieces
from .mesh_distances import MeshDistances
from .refined_pieces import refined
from .robot_model import RobotModel, world_from_parts
from .self_contacts import possible_contacts

Split = int | Mapping[str, int] | None
SMALLER, CLOSER = 0.85, 0.75
"""A link gets one more capsule if that reduces the volume, or the protrusion, to less than this fraction."""
FINGER_EXCESS = 0.006
"""Approximate largest protrusion [m] of finger capsules, small because fingers go close to objects."""
FARTHEST = 100.0
"""Largest plausible distance of a point of a part from its frame [m]."""
SAME = 1e-6
"""Tolerance [m, rad] within which joints of a model and of the arm coincide."""
BULGES = (1.02, 1.25, 2.0, 5.0, np.inf)
"""Volumes of a hull of several elements, as multiples of theirs, that are tried until the pieces are few enough."""
THIN = 1e-3
"""Share of the largest extent of points below which the smallest one may be none."""
ROUNDING = 5e-4
"""Largest distance [m] that the hull of a piece with many corners may stand off the piece."""


def body_of(robot: RobotModel, arm: Arm, split: Split, *, exact: bool = True) -> tuple[Body, tuple[str, ...]]:
    """Cover a robot's parts, named and placed as `body_readers` describes; and say what is doubtful, a line each.

    Args:
        robot: the model that was read.
        arm: the arm, read from the same model.
        split: number of capsules (1 to 3) of every piece, or of some pieces by name; None: as many as pay off.
        exact: add convex hulls, and find out which parts can hit each other; False: capsules alone.

    Raises:
        BadModel: another arm, no collision geometry, or geometry that encloses no volume.
        UnknownName: a piece in `split` that the arm lacks.
    """
    world = world_from_parts(robot.parts)
    frames = [Pose.identity(), *joint_frames(arm, robot.reference)]
    _check_same(robot, arm, world, frames)
    _check_numbers(robot)
    covering = _Covering(robot.source, split)
    if not exact:
        return covering.body(whole_pieces(robot, world, frames), hulls=False), ()
    pieces: list[Piece] = []
    for bulge in BULGES:
        pieces = convex_link_pieces(robot, world, frames, bulge)
        if len(pieces) <= MAX_CAPSULES:
            break
    covering.check(pieces)
    truth = MeshDistances(arm, pieces)
    pieces = refined(arm, pieces, truth, covering.rough, MAX_CAPSULES)
    return possible_contacts(arm, covering.body(pieces), pieces, truth)


def _check_same(robot: RobotModel, arm: Arm, world: list[Pose], frames: list[Pose]) -> None:
    """Refuse an arm that was not read from the model."""
    for name, frame, (part, axis, position) in zip(arm.joint_names, frames[1:], robot.joints, strict=True):
        direction = frame.rotation[:, 2]
        off = np.cross(moved(world[part], position) - frame.position, direction)
        if np.abs(world[part].rotation @ axis - direction).max() > SAME or np.abs(off).max() > SAME:
            raise BadModel(robot.source, name, f"is not where the arm {arm.name!r} has it: they are not the same")


def _check_numbers(robot: RobotModel) -> None:
    """Refuse geometry that is nowhere."""
    for part in robot.parts:
        for geometry in part.geometry:
            points = np.vstack([geometry.points, *(np.array(capsule[:2]) for capsule in geometry.exact)])
            if not (np.abs(points) <= FARTHEST).all():
                reason = f"its geometry has a point that is not finite or farther than {FARTHEST:g} m"
                raise BadModel(robot.source, f"part {part.name!r}", reason)


class _Covering:
    """Covers pieces, every piece once: cutting one leaves the others as they are."""

    def __init__(self, source: str, split: Split):
        self._source, self._split = source, split
        self._known: dict[tuple[int, bool], tuple[Piece, Cover]] = {}
        self._rough: dict[int, tuple[Piece, Cover]] = {}
        self._hulls: dict[int, tuple[Piece, Hull | None]] = {}

    def check(self, pieces: list[Piece]) -> None:
        """Refuse pieces that enclose no volume: they have no surface."""
        for piece in pieces:
            try:
                if len(piece.geometry.points) and _is_thin(piece.geometry.points):
                    hull_corners(piece.geometry.points)
            except UnfitShape as error:
                raise BadModel(self._source, piece.name, f"{FLAT}: {error.reason}") from None

    def body(self, pieces: list[Piece], *, hulls: bool = True) -> Body:
        """Return the body of pieces; with hulls, and with one capsule per piece if more may be too many."""
        names = {piece.name for piece in pieces}
        if isinstance(self._split, Mapping) and set(self._split) - names:
            raise UnknownName("link to split", min(set(self._split) - names), sorted(names))
        few = hulls and 2 * len(pieces) > MAX_CAPSULES
        covers = [self._of(piece, few=few, hulls=hulls) for piece in pieces]
        if hulls and sum(map(len, covers)) > MAX_CAPSULES:
            covers = [self._of(piece, few=True, hulls=True) for piece in pieces]
        return self._laid(pieces, covers, hulls=hulls)

    def rough(self, pieces: list[Piece]) -> Body:
        """Return the body of pieces with their hulls, in capsules that are found at once."""
        return self._laid(pieces, [self._rough_cover(piece) for piece in pieces], hulls=True)

    def _rough_cover(self, piece: Piece) -> Cover:
        if id(piece) not in self._rough:
            hull = self._hull(piece)
            found, more = ([], 0.0) if hull is None else (rough_capsule(hull.corners), hull.rounding)
            self._rough[id(piece)] = piece, piece.geometry.exact + [(a, b, radius + more) for a, b, radius in found]
        return self._rough[id(piece)][1]

    def _laid(self, pieces: list[Piece], covers: list[Cover], *, hulls: bool) -> Body:
        rows, labels, laid = [], [], []
        for piece, cover in zip(pieces, covers, strict=True):
            hull = self._hull(piece) if hulls else None
            hull = None if hull is None else hull.moved(piece.pose)  # capsules of a piece share it
            for a, b, radius in cover:
                rows.append([piece.frame, *moved(piece.pose, a), *moved(piece.pose, b), radius])
                labels.append(piece.name)
                laid.append(hull)
        if not rows:
            raise BadModel(self._source, "collision geometry", "the arm has none")
        if len(rows) > MAX_CAPSULES:
            reason = f"it takes {len(rows)} capsules; allowed are {MAX_CAPSULES}"
            raise BadModel(self._source, "collision geometry", reason)
        return Body(np.array(rows), tuple(labels), hulls=tuple(laid) if hulls else ())

    def _hull(self, piece: Piece) -> Hull | None:
        """Return the hull of a piece in its own frame."""
        if id(piece) not in self._hulls:
            points = piece.geometry.points
            self._hulls[id(piece)] = piece, Hull(*rounded_hull(points, ROUNDING)) if len(points) else None
        return self._hulls[id(piece)][1]

    def _of(self, piece: Piece, *, few: bool, hulls: bool) -> Cover:
        """Return the capsules of a piece; around its hull, if it has one: its corners are few."""
        key = id(piece), few
        if key not in self._known:
            hull = self._hull(piece) if hulls else None
            points = piece.geometry.points if hull is None else hull.corners
            cover = _cover(piece, points, 1 if few else self._split, self._source)
            more = 0.0 if hull is None else hull.rounding
            self._known[key] = piece, piece.geometry.exact + [(a, b, radius + more) for a, b, radius in cover]
        return self._known[key][1]


def _is_thin(points: np.ndarray) -> bool:
    """Return whether points (n, 3) may lie in a plane: a look that is cheaper than their hull."""
    extents = np.linalg.svd(points - points.mean(axis=0), compute_uv=False)
    return len(extents) < 3 or bool(extents[2] <= THIN * extents[0])


def _cover(piece: Piece, points: np.ndarray, split: Split, source: str) -> Cover:
    """Return capsules around points (n, 3) [m] of a piece."""
    if not len(points):
        return []
    count = split.get(piece.name) if isinstance(split, Mapping) else split
    try:
        if count is not None:
            return fitted_capsules(points, count)
        if piece.name == "fingers":
            return strips(points, FINGER_EXCESS)
        fit, pays = fitted_capsules(points, 1), True
        while pays and len(fit) < 3:
            finer = fitted_capsules(points, len(fit) + 1)
            pays = union_volume(finer) < SMALLER * union_volume(fit)
            pays = pays or sticks_out(finer, points) < CLOSER * sticks_out(fit, points)
            fit = finer if pays else fit
    except UnfitShape as error:
        raise BadModel(source, piece.name, f"{FLAT}: {error.reason}") from None
    return fit
