"""The pieces of a robot that are covered each by itself: links, what is welded to the hand, swept fingers.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import NamedTuple

import numpy as np

from ..errors import BadModel, UnfitShape
from ..geometry.convex_pieces import rounded_hull, thinned
from ..geometry.hulls import directions
from ..geometry.pose import Pose
from ..geometry.shapes import hull_corners
from ..geometry.triangle_surface import nearest_on_triangles
from ..robot.body import Body
from ..robot.joint_frames import moved
from .finger_sweeps import swept, through
from .robot_model import Geometry, RobotModel, joined, placed, places_of

SWEPT = ", swept"
"""End of the label of what is swept."""
ROUGH, SOME = 0.002, 2000
"""Rounding [m] of a hull, and number of points on a surface, about, by which the deepest point is found."""
DECIMALS = 12
"""Number of decimals of a pose in a link's frame, well above rounding."""
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
            geometries = [Geometry([], moved(_settled(to_frame @ world[part.parent]), points))]
        else:
            geometries = [placed(_settled(to_frame @ world[k]), geometry) for geometry in part.geometry]
        yield place.piece, frame, k, bool(part.joints), geometries


def _settled(pose: Pose) -> Pose:
    """Return a pose without the rounding of the way to it through the world, which depends on the arm's base.

    Where a capsule's optimum is flat, the last digits of its points decide about some 0.1 mm.
    """
    return Pose(np.round(pose.dq, DECIMALS) + 0.0)


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
    volumes = {k: volume(solid.points) for k, solid in left.items()}
    common: dict[tuple[int, int], float] = {}  # volumes of the hulls of pairs, each found once
    while True:
        best, least = None, bulge
        for i, j in combinations(left, 2):
            if (i, j) not in common:
                common[i, j] = volume(np.vstack([left[i].points, left[j].points]))
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


def volume(points: np.ndarray) -> float:
    """Return the volume [m^3] of the hull of points (n, 3) [m]; 0 of flat ones."""
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0


class PieceSurfaces:
    """Planes, points and thinned surfaces of pieces, each found once."""

    def __init__(self) -> None:
        self._planes: dict[int, tuple[Piece, np.ndarray]] = {}
        self._points: dict[int, tuple[Piece, np.ndarray]] = {}
        self._thin: dict[int, tuple[Piece, np.ndarray]] = {}

    def deepest(self, piece: Piece, points: np.ndarray) -> np.ndarray | None:
        """Return the point (3,) that lies deepest in a piece's hull; None if none does.

        Args:
            piece: the piece.
            points: (n, 3) in its frame [m].
        """
        from scipy.spatial import ConvexHull

        if not len(piece.geometry.triangles):
            return None
        if id(piece) not in self._planes:
            self._planes[id(piece)] = piece, ConvexHull(rounded_hull(piece.geometry.points, ROUGH)[0]).equations
        planes = self._planes[id(piece)][1]
        depth = -(points @ planes[:, :3].T + planes[:, 3]).max(axis=1)
        return points[int(depth.argmax())] if depth.max() > 0.0 else None

    def gap(self, piece: Piece, point: np.ndarray | None) -> float:
        """Return about the distance [m] of a point on a piece's hull from its surface; 0 without triangles.

        Args:
            piece: the piece.
            point: (3,) in its frame [m]; None: there is none, at a distance of 0.
        """
        if not len(piece.geometry.triangles) or point is None:
            return 0.0
        if id(piece) not in self._thin:
            self._thin[id(piece)] = piece, thinned(piece.geometry.triangles)
        return float(np.linalg.norm(point - nearest_on_triangles(point, self._thin[id(piece)][1])))

    def points(self, piece: Piece) -> np.ndarray:
        """Return points (n, 3) on a piece's surface: of the corners and the middles of its triangles, or all around."""
        if id(piece) not in self._points:
            around = [
                end + radius * directions() for a, b, radius in piece.geometry.exact for end in (a, 0.5 * (a + b), b)
            ]
            if len(piece.geometry.points):
                triangles = surface(piece.geometry)
                around += [np.unique(triangles.reshape(-1, 3), axis=0), triangles.mean(axis=1)]
            points = np.vstack(around)
            self._points[id(piece)] = piece, points[:: max(1, len(points) // SOME)]
        return self._points[id(piece)][1]
