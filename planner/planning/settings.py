"""Settings of plans: imitation, the search in joint space, and the planner as a whole."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from ..arrays import checked_array, checked_kind, numbers
from ..control.controller import ControllerSettings
from ..control.pursuit import PursuitSettings
from ..errors import BadOption
from ..escape.repet import Corner, RepetSettings
from ..imitation.constraint import KEEPING, ConstraintSettings, Keeping
from ..ranges import check_choice, check_counts, check_ranges, ticks_of
from ..safety.safety_layer import SafetySettings


@dataclass(frozen=True, slots=True)
class MotionSettings:
    """Settings by which a demonstrated segment becomes a motion.

    Attributes:
        guide: fraction of the imitated path at which the blend ends (paper: 0.2).
        max_guide: largest such fraction, beyond which too little of the path would be left.
        departure: path length [m] of the start-anchored departure; 0 for the paper's plain form.
        controller: settings of the control law.
        pursuit: settings of path following.
        dt: seconds per tick.
    """

    guide: float = 0.5
    max_guide: float = 0.75
    departure: float = 0.09
    controller: ControllerSettings = field(default_factory=ControllerSettings)
    pursuit: PursuitSettings = field(default_factory=PursuitSettings)
    dt: float = 0.02

    def __post_init__(self):
        checked_kind("controller", self.controller, ControllerSettings)
        checked_kind("pursuit", self.pursuit, PursuitSettings)
        check_ranges(self, "[0, 1]", "guide", "max_guide")
        check_ranges(self, "(0, inf)", "dt")
        if self.guide > self.max_guide:
            raise BadOption("guide", f"need 0 <= guide <= max_guide <= 1, got {self.guide} and {self.max_guide}")
        check_ranges(self, "[0, inf]", "departure")


@dataclass(frozen=True, slots=True)
class JointSearchSettings:
    """Settings of the search in joint space, an RRT-Connect.

    Attributes:
        step: longest edge [rad].
        iterations: maximum number of samples of one search in the last round.
        nodes: maximum number of nodes of each of its two trees.
        seeds: starts of the inverse kinematics per pose.
        targets: number of poses between the guiding pose and the goal at which the imitated path may be joined.
        postures: maximum number of postures that are searched for, the most promising first; the shortest path wins.
        rounds: number of rounds, each with twice as many seeds.
        margin: joint margin [rad] that a posture should have, so that the next motion is possible.
        late: cost [rad] of joining the imitated path only at its end.
        shortcuts: number of straight lines tried in place of stretches of the path.
        to_joints: number of searches for a goal given as joints, each with other random numbers.
        shortcuts_to_joints: as `shortcuts`, for a goal given as joints; more corners would cost more time than their
            lines save, since the arm rests at each.
        speed: share of the largest joint speed at which the path is followed.
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
    to_joints: int = 40
    shortcuts_to_joints: int = 30
    speed: float = 0.4

    def __post_init__(self):
        check_ranges(self, "(0, 10]", "step", "speed")
        check_ranges(self, "[0, 1000]", "late")
        check_ranges(self, "[0, inf)", "margin")
        check_counts(self, "[1, 1000000]", "iterations", "nodes", "seeds", "targets", "postures", "rounds", "to_joints")
        check_counts(self, "[0, 1000000]", "shortcuts", "shortcuts_to_joints")


BIASES: tuple[Corner, ...] = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.5), (0.0, 0.5, 0.0), (0.0, -0.5, 0.0))


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """Settings of the planner.

    Attributes:
        motion: imitation, controller and pursuit.
        repet: settings of the escape trees.
        safety: settings of the layer that keeps the whole arm clear.
        search: settings of the search in joint space, an RRT-Connect; None: no search.
        biases: biases of the detours, tried one after the other; see `RepetSettings.bias`.
        tight: factor of the planning margin in the second half of the tries.
        min_imitated_share: share of the imitated path behind the wanted guiding pose that a plan must follow to be
            taken at once; a plan that joins the path later is a fallback.
        end_margin: joint margin [rad] at the end that a plan must have to be taken at once, so that the next motion is
            possible.
        effort: maximum number of closed loops tried for something better than a fallback, and of rounds of the search
            in joint space if the fallback ends near a joint limit; 0: the first plan is taken.
        spacing: path length [m] between poses of a blend.
        max_seconds: longest motion [s].
        trees: False: no escape trees, so no detours of the tool. Without search too, the safety layer is alone.
        max_deviation: distance [m] by which the safety layer may lead the tool off its path.
        guard: False: no safety layer; a successful plan is then proven clear for the tool at most.
        constraint: tolerances of what is kept while something is carried.
        keeping: "must" (a plan that does not keep it fails), "prefer" (such a plan is taken where none is found that
            keeps it, and says what gave way), "free" (nothing is kept but by imitation).
    """

    motion: MotionSettings = field(default_factory=MotionSettings)
    repet: RepetSettings = field(default_factory=RepetSettings)
    safety: SafetySettings = field(default_factory=SafetySettings)
    search: JointSearchSettings | None = field(
        default_factory=JointSearchSettings, metadata={"formerly": "avoid", "values": {True: {}, False: None}}
    )
    biases: tuple[Corner, ...] = BIASES
    tight: float = 0.7
    min_imitated_share: float = field(default=0.4, metadata={"formerly": "keep"})
    end_margin: float = 0.05
    effort: int = 3
    spacing: float = 0.01
    max_seconds: float = 30.0
    trees: bool = field(default=True, metadata={"formerly": "avoid"})
    max_deviation: float = field(default=math.inf, metadata={"formerly": "stray"})
    guard: bool = True
    constraint: ConstraintSettings = field(default_factory=ConstraintSettings)
    keeping: Keeping = "prefer"

    def __post_init__(self):
        checked_kind("motion", self.motion, MotionSettings)
        checked_kind("repet", self.repet, RepetSettings)
        checked_kind("safety", self.safety, SafetySettings)
        if self.search is not None:
            checked_kind("search", self.search, JointSearchSettings)
        checked_kind("constraint", self.constraint, ConstraintSettings)
        check_choice("keeping", self.keeping, KEEPING)
        check_ranges(self, "(0, 1]", "tight")
        check_ranges(self, "[0, 1]", "min_imitated_share")
        check_ranges(self, "[0, inf]", "end_margin")
        check_ranges(self, "[0, 100]", "effort")
        check_ranges(self, "(0, inf]", "max_deviation")
        if not numbers("biases", self.biases).size:
            raise BadOption("biases", "there must be at least one")
        biases = checked_array("biases", self.biases, (None, 3))
        object.__setattr__(self, "biases", tuple(tuple(bias) for bias in biases.tolist()))
        check_ranges(self, "(0, 3600)", "spacing", "max_seconds")
        ticks_of(self.max_seconds, self.motion.dt)
        if self.repet.distance * self.tight < self.safety.distance:
            reason = f"{self.repet.distance} times {self.tight} is below the safety distance {self.safety.distance}"
            raise BadOption("repet.distance", reason)

    @property
    def avoids(self) -> bool:
        """True if obstacles are led round at all, by escape trees or by the search in joint space."""
        return self.trees or self.search is not None
