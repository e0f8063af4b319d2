"""TSIA in an artificial potential field: the reference pulls, obstacles push, online and without looking ahead.

The field is Khatib's (1986): `strength (i/room - 1) (i/slack)^2` along the normal, i the influence, for the closest
points of tool and obstacle; near the goal it fades (Ge and Cui 2000): else a goal beside an obstacle could not be
reached. As in a tree of REPET only the translation is deflected. Where pull and push are equal it stands still:
a local minimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner.errors import BadOption
from ...planner.geometry import dualquat as dq
from ...planner.geometry.pose import Pose, PosePath
from ...planner.imitation.tsia import final_path, imitated_path
from .path_generators import GeneratedPath, PathGenerator
from .tool_obstacles import ToolObstacles

MIN_CLEARANCE = 1e-3
"""Room [m] below which the push does not grow any more."""
ARRIVED = 5e-4
"""Offset [m] from the reference that counts as none."""


@dataclass(frozen=True, slots=True)
class FieldSettings:
    """The field.

    Attributes:
        pull: share of the offset from the reference that is taken back in a step.
        strength: of the push [m] per step: four times that much at half the influence.
        influence: room [m] at which an obstacle begins to push.
        fade: distance [m] to the goal from which on the push fades: of the tool, and of the reference where the
            obstacle belongs to the task, which is near the goal because it was there when it was shown.
        most: largest change of the offset in a step [m].
        patience: steps that it may take more than the reference has poses.
    """

    pull: float = 0.2
    strength: float = 3e-4
    influence: float = 0.1
    fade: float = 0.05
    most: float = 0.005
    patience: int = 200

    def __post_init__(self):
        for name in ("pull", "strength", "influence", "fade", "most"):
            if not 0.0 < getattr(self, name) <= 1.0:
                raise BadOption(name, f"{getattr(self, name)} is not in (0, 1]")
        if not 0 <= self.patience <= 100_000:
            raise BadOption("patience", f"{self.patience} is not from 0 to 100000")


class Potential(PathGenerator):
    """The TSIA path, deflected by a potential field step by step; where nothing is near, the TSIA path itself."""

    guided = True
    avoids = True

    def __init__(self, settings: FieldSettings):
        self.settings = settings

    def make(self, shown: PosePath, start: Pose, goal: Pose, guide: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        imitated = imitated_path(shown, goal)
        reference = final_path(start, imitated, guide)
        return self._made(reference, [reference.dqs[0]], [(reference, 0, np.zeros(3))], near)

    def renewed(self, made: GeneratedPath, index: int, near: ToolObstacles) -> GeneratedPath:
        """See `PathGenerator`."""
        states = list(made.states[: index + 1])
        return self._made(states[-1][0], list(made.path.dqs[: index + 1]), states, near)

    def _made(self, reference: PosePath, rows: list, states: list, near: ToolObstacles) -> GeneratedPath:
        """Go on from the last state: (reference, index in it, offset from it (3,))."""
        _, index, offset = states[-1]
        last = len(reference) - 1
        for _ in range(last - index + self.settings.patience):
            if index == last and np.linalg.norm(offset) < ARRIVED:
                break
            index = min(index + 1, last)
            offset = offset + self._change(reference, index, offset, near)
            if index == last and np.linalg.norm(offset) < ARRIVED:
                offset = np.zeros(3)
            rows.append(_shifted(reference.dqs[index], offset))
            states.append((reference, index, offset))
        return GeneratedPath(PosePath(np.array(rows)), tuple(states))

    def _change(self, reference: PosePath, index: int, offset: np.ndarray, near: ToolObstacles) -> np.ndarray:
        """Of the offset, in one step: the pull of the reference and the push of what is near."""
        settings, position = self.settings, dq.translation(reference.dqs[index])
        change = -settings.pull * offset
        goal = dq.translation(reference.dqs[-1])
        for each in near.at(position + offset, reference.dqs[index, :4], settings.influence):
            left = float(np.linalg.norm((position if each.known else position + offset) - goal))
            fading, ratio = min(1.0, left / settings.fade) ** 2, each.reach / max(each.slack, MIN_CLEARANCE)
            change = change + fading * settings.strength * (ratio - 1.0) * ratio**2 * each.normal
        return change * min(1.0, settings.most / max(float(np.linalg.norm(change)), 1e-12))


def _shifted(pose: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """A dual quaternion (8,) moved in the world; the same bits where the offset is none."""
    if not offset.any():
        return pose
    return dq.mul(dq.from_position_quaternion(offset, np.array([1.0, 0.0, 0.0, 0.0])), pose)
