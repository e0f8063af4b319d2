"""How one motion of a task is made from a demonstrated segment: what is shared by all that plan and follow it."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..control.controller import ControllerSettings
from ..control.pursuit import PursuitSettings
from ..errors import BadOption
from ..escape.repet import Corner, RepetSettings
from ..safety.safety_layer import SafetySettings


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """How a demonstrated segment becomes a motion.

    Attributes:
        guide: fraction of the imitated path at which the blend ends (paper: 0.2).
        max_guide: fraction behind which too little of the path would be left.
        departure: screw length [m] of the start-anchored departure; 0 for the paper's plain form.
        controller: the control law.
        pursuit: how a path is followed.
        dt: seconds per tick.
    """

    guide: float = 0.5
    max_guide: float = 0.75
    departure: float = 0.09
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    pursuit: PursuitSettings = field(default_factory=PursuitSettings)
    dt: float = 0.02

    def __post_init__(self):
        if not 0.0 <= self.guide <= self.max_guide <= 1.0:
            raise BadOption("guide", f"need 0 <= guide <= max_guide <= 1, got {self.guide} and {self.max_guide}")
        if self.departure < 0.0:
            raise BadOption("departure", f"{self.departure} is negative")


@dataclass(frozen=True, slots=True)
class JointSearchSettings:
    """The search in joint space.

    Attributes:
        step: longest edge [rad].
        iterations: most samples of one search in the last round.
        nodes: most nodes of one of its two trees.
        seeds: starts of the inverse kinematics per pose.
        targets: poses of the demonstrated path's tail that are aimed at, from the guiding pose to the goal.
        postures: most postures that are searched for, the most promising first; the shortest way is taken.
        rounds: how often, each time with twice as many seeds.
        margin: smallest joint margin [rad] that a posture should have, so that the next leg has somewhere to go.
        late: what coming back to the demonstrated path only at its end costs, in radians of way.
        shortcuts: straight lines that are tried in place of stretches of what was found.
        speed: of the largest joint speed, on the way found.
    """

    step: float = 0.3
    iterations: int = 3000
    nodes: int = 3000
    seeds: int = 48
    targets: int = 3
    postures: int = 4
    rounds: int = 3
    margin: float = 0.15
    late: float = 3.0
    shortcuts: int = 300
    speed: float = 0.4

    def __post_init__(self):
        for name in ("step", "speed"):
            if not 0 < getattr(self, name) <= 10:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number up to 10")
        if not 0.0 <= self.late <= 1000.0:
            raise BadOption("late", f"{self.late} is not from 0 to 1000")
        for name in ("iterations", "nodes", "seeds", "targets", "postures", "rounds"):
            if not 1 <= getattr(self, name) <= 10**6:
                raise BadOption(name, f"{getattr(self, name)} is not from 1 to a million")


BIASES: tuple[Corner, ...] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, -0.5, 0.0))


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """How a leg is planned.

    Attributes:
        motion: imitation, controller and pursuit.
        repet: escape trees.
        safety: the layer that keeps the whole arm clear.
        search: the search in joint space; None for none.
        biases: what detours are tried for, one after the other; see `RepetSettings.bias`.
        tight: factor of the planning margin in the second half of the tries.
        min_imitated_share: share of the demonstrated path behind the wanted guiding pose that a plan must
            follow to be taken at once; one that comes back to it later, is a fallback.
        end_margin: distance to a joint limit [rad] that the last joints must have for the same, so that the next
            leg has somewhere to go.
        effort: most closed loops that are tried in search of something better than a fallback, and rounds of the
            search in joint space if the fallback ends at a joint limit; 0: the first plan is taken as it is.
        spacing: screw length [m] between poses of a blend.
        max_seconds: longest motion.
        avoid: False: no detours and no search, the safety layer alone.
        max_deviation: distance [m] from what it follows that the tool may be led away by the safety layer.
        guard: False: no safety layer; what is returned with success is then proven clear for the tool at most.
    """

    motion: MotionSettings = field(default_factory=MotionSettings)
    repet: RepetSettings = field(default_factory=RepetSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    search: JointSearchSettings | None = field(default_factory=JointSearchSettings)
    biases: tuple[Corner, ...] = BIASES
    tight: float = 0.7
    min_imitated_share: float = field(default=0.4, metadata={"formerly": "keep"})
    end_margin: float = 0.05
    effort: int = 3
    spacing: float = 0.01
    max_seconds: float = 30.0
    avoid: bool = True
    max_deviation: float = field(default=math.inf, metadata={"formerly": "stray"})
    guard: bool = True

    def __post_init__(self):
        if not 0.0 < self.tight <= 1.0:
            raise BadOption("tight", f"{self.tight} is not in (0, 1]")
        if not 0.0 <= self.min_imitated_share <= 1.0:
            raise BadOption("min_imitated_share", f"{self.min_imitated_share} is not from 0 to 1")
        if not self.end_margin >= 0.0:
            raise BadOption("end_margin", f"{self.end_margin} is not a number >= 0")
        if not 0 <= self.effort <= 100:
            raise BadOption("effort", f"{self.effort} is not from 0 to 100")
        if not self.max_deviation > 0.0:
            raise BadOption("max_deviation", f"{self.max_deviation} is not a positive number")
        if not self.biases:
            raise BadOption("biases", "there must be at least one")
        for name in ("spacing", "max_seconds"):
            if not 0 < getattr(self, name) < 3600:
                raise BadOption(name, f"{getattr(self, name)} is not a positive number below 3600")
        if self.repet.distance * self.tight < self.safety.distance:
            reason = f"{self.repet.distance} times {self.tight} is below the safety distance {self.safety.distance}"
            raise BadOption("repet.distance", reason)
