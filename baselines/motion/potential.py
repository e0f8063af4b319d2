"""TSIA in an artificial potential field: the reference pulls, obstacles push, online and without lookahead.

The field is Khatib's (1986): `strength (i/slack - 1) (i/slack)^2` along the normal, i the influence, for the closest
points of tool and obstacle; near the goal the field fades (Ge and Cui 2000), or a goal beside an obstacle would be
unreachable. As in a REPET tree, only the translation is deflected. Where pull and push balance, the motion stops in a
local minimum.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...planner import Pose, PosePath, final_path, imitated_path
from ...planner.geometry import dualquat as dq
from ...planner.ranges import check_ranges
from .path_generators import GeneratedPath, PathGenerator
from .tool_obstacles import ToolObstacles

MIN_CLEARANCE = 1e-3
"""Slack [m] below which the push no longer grows."""
ARRIVED = 5e-4
"""Offset [m] from the reference that counts as zero."""


@dataclass(frozen=True, slots=True)
class FieldSettings:
    """Settings of the potential field.

    Attributes:
        pull: fraction of the offset from the reference removed per step.
        strength: of the push [m] per step: four times this at half the influence.
        influence: slack [m] at which an obstacle begins to push.
        fade: distance [m] to the goal below which the push fades: distance of the tool, or of the reference if the
            obstacle belongs to the task and was near the goal in the demonstration too.
        most: largest change of the offset in a step [m].
        patience: largest number of steps in excess of the reference's poses.
    """

    pull: float = 0.2
    strength: float = 3e-4
    influence: float = 0.1
    fade: float = 0.05
    most: float = 0.005
    patience: int = 200

    def __post_init__(self):
        check_ranges(self, "(0, 1]", "pull", "strength", "influence", "fade", "most")
        check_ranges(self, "[0, 100000]", "patience")


class Potential(PathGenerator):
    """The TSIA path, deflected by a potential field step by step; without obstacles nearby, the TSIA path itself.

    Args:
        settings: see `FieldSettings`.
    """

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
        """Continue from the last state: (reference, index of its pose, offset from that pose (3,) [m])."""
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
        """Return the change (3,) [m] of the offset in a step: pull of the reference plus push of nearby obstacles."""
        settings, position = self.settings, dq.translation(reference.dqs[index])
        change = -settings.pull * offset
        goal = dq.translation(reference.dqs[-1])
        for each in near.at(position + offset, reference.dqs[index, :4], settings.influence):
            left = float(np.linalg.norm((position if each.known else position + offset) - goal))
            fading, ratio = min(1.0, left / settings.fade) ** 2, each.reach / max(each.slack, MIN_CLEARANCE)
            change = change + fading * settings.strength * (ratio - 1.0) * ratio**2 * each.normal
        return change * min(1.0, settings.most / max(float(np.linalg.norm(change)), 1e-12))


def _shifted(pose: np.ndarray, offset: np.ndarray) -> np.ndarray:
    """Translate a dual quaternion (8,) in the world; bit-identical if the offset is zero."""
    if not offset.any():
        return pose
    return dq.mul(dq.from_position_quaternion(offset, np.array([1.0, 0.0, 0.0, 0.0])), pose)
