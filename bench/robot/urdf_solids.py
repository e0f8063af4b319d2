"""The true shapes of a URDF's links: Pinocchio reads them and places them."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig
from ...planner import Pose
from .true_solids import TrueShape, TrueSolids, box_shape, hull_triangles, mesh_shape, round_shape


class UrdfSolids(TrueSolids):
    """The collision elements of a URDF file.

    Joints that are neither the arm's nor given stand at 0, or at the nearer limit.

    Args:
        urdf: the file; it is read anew, with Pinocchio.
        joint_names: of the arm.
        others: joint name: position [rad or m], which may lie beyond the limits of the file.
        base: pose of the root link in the world.
        package_dirs: folders of the packages of `package://`; None: the folders above the file.
        covered: links whose elements count; None: all.
        visuals: links without collision elements have their visual ones.

    Raises:
        BadConfig: the model cannot be read, or a joint is not in it.
    """

    def __init__(
        self,
        urdf: Path,
        joint_names: Sequence[str],
        others: Mapping[str, float],
        base: Pose | None = None,
        *,
        package_dirs: Sequence[Path] | None = None,
        covered: Collection[str] | None = None,
        visuals: bool = False,
    ):
        import pinocchio as pin

        self._pin, self._urdf, self._base = pin, urdf, base or Pose.identity()
        folders = urdf.resolve().parents if package_dirs is None else package_dirs
        try:
            self._model = pin.buildModelFromUrdf(str(urdf))
            self._geometry = self._read(pin.COLLISION, folders)
            if visuals:
                self._add_visuals(folders)
        except (ValueError, RuntimeError) as error:
            raise BadConfig(urdf, "collision geometry", str(error).strip().splitlines()[0]) from None
        self._data, self._placed = self._model.createData(), self._geometry.createData()
        items = list(self._geometry.geometryObjects)
        links = [self._link(item) for item in items]
        self._kept = [k for k, link in enumerate(links) if covered is None or link in covered]
        self._joints = [int(items[k].parentJoint) for k in self._kept]
        self._rest = self._start()
        for name, value in others.items():
            self._write(self._rest, self._joint(name), value)
        self._own = [self._joint(name) for name in joint_names]
        moved = {int(self._model.getJointId(name)) for name in joint_names}
        self._moving = frozenset(k for k, joint in enumerate(self._joints) if moved & set(self._above(joint)))
        super().__init__(_shape_of(items[k], links[k], urdf) for k in self._kept)

    @property
    def moving(self) -> frozenset[int]:
        """Indices of the elements that the arm moves: what stands on a joint that is held cannot run into anything."""
        return self._moving

    def _above(self, joint: int) -> Iterator[int]:
        """Yield a joint and all joints above it."""
        while joint > 0:
            yield joint
            joint = int(self._model.parents[joint])

    def neighbors(self) -> set[frozenset[str]]:
        """Return the pairs of links on one joint, or on a joint and the one before it."""
        parents, found = self._model.parents, set()
        for j, one in zip(self._joints, self.links, strict=True):
            for k, other in zip(self._joints, self.links, strict=True):
                if j == k or int(parents[j]) == k or int(parents[k]) == j:
                    found.add(frozenset((one, other)))
        return found

    def _poses(self, q: np.ndarray) -> Iterator[tuple[np.ndarray, np.ndarray]]:
        config = self._rest.copy()
        for joint, value in zip(self._own, q, strict=True):
            self._write(config, joint, value)
        self._pin.updateGeometryPlacements(self._model, self._data, self._geometry, self._placed, config)
        rotation, position = self._base.rotation, self._base.position
        for k in self._kept:
            pose = self._placed.oMg[k]
            yield rotation @ pose.rotation, rotation @ pose.translation + position

    def _read(self, kind: Any, folders: Sequence[Path] | Sequence[str]) -> Any:
        dirs = [str(folder) for folder in folders]
        return self._pin.buildGeomFromUrdf(self._model, str(self._urdf), kind, package_dirs=dirs)

    def _add_visuals(self, folders: Sequence[Path] | Sequence[str]) -> None:
        seen = {self._link(item) for item in self._geometry.geometryObjects}
        for item in self._read(self._pin.VISUAL, folders).geometryObjects:
            if self._link(item) not in seen:
                item.name = f"{item.name} (visual)"
                self._geometry.addGeometryObject(item)

    def _link(self, item: Any) -> str:
        return str(self._model.frames[int(item.parentFrame)].name)

    def _joint(self, name: str) -> Any:
        if not self._model.existJointName(name):
            raise BadConfig(self._urdf, name, f"no such joint; known: {', '.join(self._model.names[1:])}")
        joint = self._model.joints[self._model.getJointId(name)]
        if int(joint.nv) != 1:
            raise BadConfig(self._urdf, name, "is neither a hinge nor a slide")
        return joint

    def _start(self) -> np.ndarray:
        """Return the neutral configuration, joints of one number within their limits."""
        start = self._pin.neutral(self._model)
        for joint in list(self._model.joints)[1:]:
            if int(joint.nq) == 1:
                k = int(joint.idx_q)
                start[k] = np.clip(start[k], self._model.lowerPositionLimit[k], self._model.upperPositionLimit[k])
        return start

    @staticmethod
    def _write(config: np.ndarray, joint: Any, value: float) -> None:
        """Put a joint to a position [rad or m]; Pinocchio holds joints without limits as cosine and sine."""
        first, count = int(joint.idx_q), int(joint.nq)
        config[first : first + count] = value if count == 1 else (np.cos(value), np.sin(value))


def _shape_of(item: Any, link: str, urdf: Path) -> TrueShape:
    form, name = item.geometry, type(item.geometry).__name__
    if name == "Box":
        return box_shape(link, (2.0 * float(half) for half in form.halfSide))
    if name in ("Cylinder", "Capsule"):
        return round_shape(link, name, float(form.radius), 2.0 * float(form.halfLength))
    if name == "Sphere":
        return round_shape(link, name, float(form.radius), 0.0)
    if name.startswith("Convex"):  # what Pinocchio makes of some meshes of few corners
        return mesh_shape(link, hull_triangles(np.array(form.points(), dtype=np.float64)))
    if not hasattr(form, "tri_indices"):
        raise BadConfig(urdf, str(item.name), f"is a {name}; known are boxes, balls, capsules, cylinders and meshes")
    points = np.array(form.vertices(), dtype=np.float64).reshape(-1, 3)
    corners = [[int(form.tri_indices(k)[corner]) for corner in range(3)] for k in range(int(form.num_tris))]
    return mesh_shape(link, points[np.array(corners, dtype=int)])
