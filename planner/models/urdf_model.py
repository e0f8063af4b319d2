"""URDF models in Pinocchio: joints, frames, and the geometry of links."""

from __future__ import annotations

from collections.abc import Sequence
from difflib import get_close_matches
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ..errors import BadModel
from ..geometry.pose import Pose
from .model_joints import OTHER, SLIDES, TURNS, ModelJoint
from .model_report import SHOWN, listed
from .urdf_file import UrdfFile, read_urdf_file


class UrdfModel(NamedTuple):
    """A URDF file and its model in Pinocchio.

    Attributes:
        file: the content that Pinocchio does not show.
        pinocchio: `pinocchio.Model`; its joint 0 is the root.
        joints: all joints that move, by name, in the order of Pinocchio; the axis of one without a direction holds NaN.
    """

    file: UrdfFile
    pinocchio: Any
    joints: dict[str, ModelJoint]

    @property
    def source(self) -> Path:
        """The file."""
        return self.file.source

    def placement(self, index: int) -> Pose:
        """Return the pose of a joint's frame in that of its parent joint."""
        return Pose.from_matrix(self.pinocchio.jointPlacements[index].homogeneous)

    def path(self, index: int) -> list[int]:
        """Return the joints from the root (excluded) to a joint (included)."""
        path = []
        while index != 0:
            path.append(index)
            index = int(self.pinocchio.parents[index])
        return path[::-1]

    def frame(self, name: str) -> tuple[int, Any]:
        """Return a link's or else a joint's frame: the joint it moves with and its placement there.

        Raises:
            BadModel: no such link or joint.
        """
        import pinocchio as pin

        model = self.pinocchio
        for kind in (pin.FrameType.BODY, pin.FrameType.JOINT, pin.FrameType.FIXED_JOINT):
            if model.existFrame(name, kind):
                frame = model.frames[model.getFrameId(name, kind)]
                return _joint_of(frame), frame.placement
        names = list(dict.fromkeys(frame.name for frame in model.frames[1:]))
        close = get_close_matches(name, names, n=SHOWN, cutoff=0.5)
        known = listed([*close, *(other for other in names if other not in close)], 3 * SHOWN)
        raise BadModel(self.source, f"frame {name!r}", f"not in the model; frames: {known}")

    def links(self) -> list[tuple[str, int]]:
        """Return the name of every link, and the joint it moves with."""
        import pinocchio as pin

        frames = self.pinocchio.frames
        return [(frame.name, _joint_of(frame)) for frame in frames if frame.type == pin.FrameType.BODY]

    def geometry(self, package_dirs: Sequence[str | Path] | None, *, visual: bool = False) -> list[Any]:
        """Return all collision or visual elements, as Pinocchio's `GeometryObject`.

        Args:
            package_dirs: folders of the packages of `package://`; default: the folders above the file.
            visual: the visual elements instead of the collision elements.

        Raises:
            BadModel: a mesh that cannot be read.
        """
        import pinocchio as pin

        folders = self.source.resolve().parents if package_dirs is None else package_dirs
        kind = pin.VISUAL if visual else pin.COLLISION
        try:
            found = pin.buildGeomFromUrdf(
                self.pinocchio, str(self.source), kind, package_dirs=[str(folder) for folder in folders]
            )
        except (ValueError, RuntimeError) as error:
            what = "visual geometry" if visual else "collision geometry"
            reason = str(error).strip().splitlines()[0]
            raise BadModel(self.source, what, f"cannot be read: {reason} (see package_dirs)") from None
        return list(found.geometryObjects)


def read_urdf(path: str | Path) -> UrdfModel:
    """Read a URDF file.

    Raises:
        BadModel: the file cannot be read, see `read_urdf_file`.
    """
    import pinocchio as pin

    file = read_urdf_file(path)
    try:
        model = pin.buildModelFromUrdf(str(file.source))
    except (ValueError, RuntimeError) as error:
        raise BadModel(file.source, "URDF", f"cannot be read: {str(error).splitlines()[0]}") from None
    data, neutral = model.createData(), pin.neutral(model)
    for frame in model.frames:
        if frame.type == pin.FrameType.BODY and frame.name not in file.links:
            raise BadModel(file.source, f"link {frame.name!r}", "its name holds a line break or a tab")
    joints = [_joint(model, index, data, neutral) for index in range(1, model.njoints)]
    return UrdfModel(file, model, {joint.name: joint for joint in joints})


def _joint_of(frame: Any) -> int:
    # `parent` was renamed in Pinocchio 3
    return int(frame.parentJoint if hasattr(frame, "parentJoint") else frame.parent)


def _joint(model: Any, index: int, data: Any, neutral: np.ndarray) -> ModelJoint:
    joint, name = model.joints[index], model.names[index]
    if joint.nv != 1:
        return ModelJoint(name, OTHER, np.array([0.0, 0.0, 1.0]), np.zeros(3), -np.inf, np.inf, 0.0)
    low, high = -np.inf, np.inf
    if joint.nq == 1:
        low, high = float(model.lowerPositionLimit[joint.idx_q]), float(model.upperPositionLimit[joint.idx_q])
    axis, kind = _axis(model, index, data, neutral)
    return ModelJoint(name, kind, axis, np.zeros(3), low, high, 0.0)


def _axis(model: Any, index: int, data: Any, neutral: np.ndarray) -> tuple[np.ndarray, str]:
    """Read axis and kind of a joint from its own column of the Jacobian in its own frame."""
    import pinocchio as pin

    # for a model of one joint Pinocchio returns a vector; a copy, since the columns of other joints stay as they were
    jacobian = np.array(pin.computeJointJacobian(model, data, neutral, index)).reshape(6, -1)
    column = jacobian[:, model.joints[index].idx_v].copy()
    if not abs(np.linalg.norm(column) - 1.0) < 1e-6:
        return np.full(3, np.nan), TURNS
    return (column[3:], TURNS) if np.linalg.norm(column[3:]) > 0.5 else (column[:3], SLIDES)
