"""How one motion of a task is made from a demonstrated segment: what is shared by all that plan and follow it."""

from __future__ import annotations

from dataclasses import dataclass, field

from .controller import ControllerSettings
from .errors import BadOption
from .pursuit import PursuitSettings


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
