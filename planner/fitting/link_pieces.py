"""The pieces of a robot that are covered each by itself: links, what is welded to the hand, swept fingers.

Not in the paper: the paper moves a point.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from ..geometry.pose import Pose
from ..robot.joint_frames import moved
from .finger_sweeps import swept, through
from .robot_model import Geometry, RobotModel, joined, placed


class Piece(NamedTuple):
    """Geometry covered together.

    Attributes:
        name: of its capsules.
        frame: index of the frame the piece moves with; -1: the base's, which is the world.
        pose: `frame_from_piece`.
        geometry: in the piece's own frame, so that the fit does not depend on the arm's base pose.
    """

    name: str
    frame: int
    pose: Pose
    geometry: Geometry

    def with_triangles(self, triangles: np.ndarray) -> Piece:
        """Return the piece with a part (k, 3, 3) of its surface only."""
        return self._replace(geometry=Geometry([], np.unique(triangles.reshape(-1, 3), axis=0), triangles))


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
    for name, frame, k, geometries in _elements(robot, world, frames):
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
    """
    found: dict[tuple[int, str, int], list[Geometry]] = {}
    for name, frame, k, geometries in _elements(robot, world, frames):
        # parts of the base have frames of their own
        found.setdefault((frame, name, k if frame < 0 else -1), []).extend(geometries)
    pieces = []
    for (frame, name, key), geometries in found.items():
        exact = [Geometry([capsule], np.zeros((0, 3))) for geometry in geometries for capsule in geometry.exact]
        solid = [Geometry([], g.points, g.triangles) for g in geometries if len(g.points)]
        for geometry in exact + _merged(solid, bulge):
            pieces.append(_piece(name, frame, key, world, geometry))
    return _ordered(pieces)


def _elements(robot: RobotModel, world: list[Pose], frames: list[Pose]):
    """Yield the name, the frame, the part's index and the geometries of all that belongs to the arm.

    Geometries are in the frame, but those of the base in the frame of their part.
    """
    last = len(frames) - 2
    owner: list[int | None] = []
    moving: list[bool] = []
    for k, part in enumerate(robot.parts):
        above, under = (None, False) if part.parent < 0 else (owner[part.parent], moving[part.parent])
        frame = above if part.frame is None else part.frame
        owner.append(frame)
        moving.append(under or len(part.joints) > 0)
        beside = part.frame is None and frame == -1
        if frame is None or beside or under:
            continue
        to_frame = (world[k] if frame < 0 else frames[frame + 1]).inverse()
        on_hand = part.frame is None and frame == last
        if part.joints:
            points = through(robot, part, swept(robot, k))
            geometries = [Geometry([], moved(to_frame @ world[part.parent], points))]
        else:
            geometries = [placed(to_frame @ world[k], geometry) for geometry in part.geometry]
        name = ("fingers" if part.joints else "hand") if on_hand else f"link{frame + 1}"
        yield name, frame, k, geometries


def _piece(name: str, frame: int, key: int, world: list[Pose], geometry: Geometry) -> Piece:
    return Piece(name, frame, world[key] if frame < 0 else Pose.identity(), geometry)


def _ordered(pieces: list[Piece]) -> list[Piece]:
    """Pieces with geometry, the base first, the hand and the fingers last."""
    pieces = [piece for piece in pieces if piece.geometry.exact or len(piece.geometry.points)]
    return sorted(pieces, key=lambda p: (p.frame, {"hand": 1, "fingers": 2}.get(p.name, 0)))


def _merged(solids: list[Geometry], bulge: float) -> list[Geometry]:
    """Merge solids, the best pair first, as long as their hull is hardly larger than they are together."""
    volumes = [_volume(solid.points) for solid in solids]
    while len(solids) > 1:
        best, least = None, bulge
        for i in range(len(solids)):
            for j in range(i + 1, len(solids)):
                both = _volume(np.vstack([solids[i].points, solids[j].points]))
                ratio = both / max(volumes[i] + volumes[j], 1e-12)
                if ratio <= least:
                    best, least = (i, j, both), ratio
        if best is None:
            break
        i, j, both = best
        one, other = solids[i], solids[j]
        triangles = np.zeros((0, 3, 3))
        if len(one.triangles) or len(other.triangles):
            triangles = np.concatenate([surface(one), surface(other)])
        solids = [s for k, s in enumerate(solids) if k not in (i, j)]
        volumes = [v for k, v in enumerate(volumes) if k not in (i, j)]
        solids.append(Geometry([], np.vstack([one.points, other.points]), triangles))
        volumes.append(both)
    return solids


def surface(solid: Geometry) -> np.ndarray:
    """Return the triangles (n, 3, 3) [m] of a solid's surface: its own, or those of its hull."""
    from scipy.spatial import ConvexHull

    return solid.triangles if len(solid.triangles) else solid.points[ConvexHull(solid.points).simplices]


def _volume(points: np.ndarray) -> float:
    from scipy.spatial import ConvexHull, QhullError

    try:
        return float(ConvexHull(points).volume)
    except (QhullError, ValueError):
        return 0.0
