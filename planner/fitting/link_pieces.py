"""The pieces of a robot that are covered each by itself: links, what is welded to the hand, swept fingers.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..errors import BadModel, UnfitShape
from ..geometry.pose import Pose
from ..geometry.shapes import hull_corners
from ..robot.body import Body
from ..robot.joint_frames import moved
from .finger_sweeps import swept, through
from .robot_model import Geometry, RobotModel, joined, placed, places_of

SWEPT = ", swept"
"""End of the label of what is swept."""
FLAT = "the points of its geometry cannot be covered"


class Piece(NamedTuple):
    """Geometry covered together.

    Attributes:
        name: of its capsules.
        frame: index of the frame the piece moves with; -1: the base's, which is the world.
        pose: `frame_from_piece`.
        geometry: in the piece's own frame, so that the fit does not depend on the arm's base pose.
        swept: it is where joints that are not the arm's may take it.
    """

    name: str
    frame: int
    pose: Pose
    geometry: Geometry
    swept: bool = False

    @property
    def label(self) -> str:
        """Name of what it can hit others together with: what is swept may always touch what its link never does."""
        return self.name + SWEPT if self.swept else self.name

    def with_triangles(self, triangles: np.ndarray) -> Piece:
        """Return the piece with a part (k, 3, 3) of its surface only."""
        return self._replace(geometry=Geometry([], hull_points(triangles.reshape(-1, 3)), triangles))


def whole_pieces(robot: RobotModel, world: list[Pose], frames: list[Pose]) -> list[Piece]:
    """Return every link as one piece, one of all that is welded to the last link, and one of all that moves on it.

    Args:
        robot: the model.
        world: poses of its parts.
        frames: poses of the base and of the arm's joint frames.

    Returns:
        The pieces, the base first.
    """
    found: dict[tuple[int, str, int], list[Geometry]] = {}
    for name, frame, k, _, geometries in _elements(robot, world, frames):
        key = -1 if name in ("hand", "fingers") else k
        found.setdefault((frame, name, key), []).extend(geometries)
    return _ordered([_piece(name, frame, key, world, joined(found[frame, name, key])) for frame, name, key in found])


def convex_link_pieces(robot: RobotModel, world: list[Pose], frames: list[Pose], bulge: float) -> list[Piece]:
    """Return convex pieces: every collision element by itself, unless its hull with others is hardly larger.

    Args:
        robot: the model.
        world: poses of its parts.
        frames: poses of the base and of the arm's joint frames.
        bulge: largest volume of a hull of several elements, as a multiple of the sum of theirs.

    Returns:
        The pieces, the base first; of each the hull, or the capsules, are its geometry.

    Raises:
        BadModel: geometry that encloses no volume.
    """
    found: dict[tuple[int, str, int, bool], list[Geometry]] = {}
    for name, frame, k, is_swept, geometries in _elements(robot, world, frames):
        # parts of the base have frames of their own
        found.setdefault((frame, name, k if frame < 0 else -1, is_swept), []).extend(geometries)
    pieces = []
    for (frame, name, key, is_swept), geometries in found.items():
        exact = [Geometry([capsule], np.zeros((0, 3))) for geometry in geometries for capsule in geometry.exact]
        solid = [Geometry([], hull_points(g.points), g.triangles) for g in geometries if len(g.points)]
        try:
            whole = exact + _merged(solid, bulge)
        except UnfitShape as error:
            raise BadModel(robot.source, name, f"{FLAT}: {error.reason}") from None
        pieces += [_piece(name, frame, key, world, geometry)._replace(swept=is_swept) for geometry in whole]
    return _ordered(pieces)


def _elements(robot: RobotModel, world: list[Pose], frames: list[Pose]):
    """Yield the name, the frame, the part's index, whether it is swept, and the geometries of all that is the arm's.

    Geometries are in the frame, but those of the base in the frame of their part.
    """
    for k, (part, place) in enumerate(zip(robot.parts, places_of(robot.parts, len(frames) - 1), strict=True)):
        frame = place.frame
        if frame is None or not place.piece or place.below:
            continue
        to_frame = (world[k] if frame < 0 else frames[frame + 1]).inverse()
        if part.joints:
            points = through(robot, part, swept(robot, k))
            geometries = [Geometry([], moved(to_frame @ world[part.parent], points))]
        else:
            geometries = [placed(to_frame @ world[k], geometry) for geometry in part.geometry]
        yield place.piece, frame, k, bool(part.joints), geometries


def owners_of(body: Body, pieces: Sequence[Piece]) -> list[Piece]:
    """Return the piece of every capsule: pieces are covered in order, those with one hull by the same piece.

    Args:
        body: a body of the pieces, with their hulls.
        pieces: in the order of its capsules.
    """
    owners, left, last = [], iter(pieces), None
    for hull in body.hulls:
        if hull is None or hull is not last or not owners:
            owners.append(next(left))
        else:
            owners.append(owners[-1])
        last = hull
    return owners


def _piece(name: str, frame: int, key: int, world: list[Pose], geometry: Geometry) -> Piece:
    return Piece(name, frame, world[key] if frame < 0 else Pose.identity(), geometry)


def _ordered(pieces: list[Piece]) -> list[Piece]:
    """Pieces with geometry, the base first, the hand and the fingers last."""
    pieces = [piece for piece in pieces if piece.geometry.exact or len(piece.geometry.points)]
    return sorted(pieces, key=lambda p: (p.frame, {"hand": 1, "fingers": 2}.get(p.name, 0)))


def _merged(solids: list[Geometry], bulge: float) -> list[Geometry]:
    """Merge solids, the best pair first, as long as their hull is hardly larger than they are together."""
    left = dict(enumerate(solids))
    if len(left) < 2:
        return solids
    volumes = {k: _volume(solid.points) for k, solid in left.items()}
    common: dict[tuple[int, int], float] = {}  # volumes of the hulls of pairs, each found once
    while True:
        best, least = None, bulge
        for i, j in combinations(left, 2):
            if (i, j) not in common:
                common[i, j] = _volume(np.vstack([left[i].points, left[j].points]))
            ratio = common[i, j] / max(volumes[i] + volumes[j], 1e-12)
            if ratio <= least:
                best, least = (i, j), ratio
        if best is None:
            return list(left.values())
        one, other = left.pop(best[0]), left.pop(best[1])
        triangles = np.zeros((0, 3, 3))
        if len(one.triangles) or len(other.triangles):
            triangles = np.concatenate([surface(one), surface(other)])
        new = 1 + max(volumes)
        left[new] = Geometry([], hull_points(np.vstack([one.points, other.points])), triangles)
        volumes[new] = common[best]


def surface(solid: Geometry) -> np.ndarray:
    """Return the triangles (n, 3, 3) [m] of a solid's surface: its own, or those of its hull.

    Raises:
        UnfitShape: it has none, and its points enclose no volume.
    """
    from scipy.spatial import ConvexHull, QhullError

    if len(solid.triangles):
        return solid.triangles
    try:
        return solid.points[ConvexHull(solid.points).simplices]
    except (QhullError, ValueError):
        raise UnfitShape("solid", "points", "they enclose no volume") from None


def hull_points(points: np.ndarray) -> np.ndarray:
    """Return the corners (k, 3) of the hull of points (n, 3); of flat ones all."""
    try:
        return points[hull_corners(points)]
    except UnfitShape:
        return points


def _volume(points: np.ndarray) -> float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0
