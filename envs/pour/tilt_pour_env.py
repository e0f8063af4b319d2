"""Pouring with the source in the hand, in front of the target."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.reset_options import check_known, checked_joints
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv
from ..judge.dense_reward import near, tilting
from ..scene.beads import poured_into
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import SOURCE, TARGET, TILT_POUR
from .geometry import BACK, BEADS, TILTED, UP, pouring, tcp_from_glass
from .layout import GAP, RANGES, checked_stands, pour_layout
from .pour_env import PourEnv
from .rules import ENOUGH, SPILLED, PourProgress, rim_gap, tilt_of

OPTIONS = ("level", "stands", "joint_positions")
ASIDE = {"L0": 0.0, "L1": 0.03, "L2": 0.06}
"""Largest shift [m] of the held glass in x, y and z, by layout name."""
TURNS = np.deg2rad((0.0, 15.0, -15.0, 30.0, -30.0))
"""Turns [rad] of the direction of pouring from the nominal one; the first in which pouring is possible is used."""
TILTS = tuple(np.linspace(0.0, 1.0, 9))
"""Shares of the pouring tilt at which a posture must be reachable from the start."""
MAX_STARTS = 200


class TiltProgress(PourProgress):
    """Progress of pouring from a source that is in the hand from the start."""

    def reward(self, state: State) -> float:
        """See `Progress`."""
        if self.success:
            return 1.0
        source, target = state.object_pose
        distance = max(0.0, float(rim_gap(source, self._sizes[SOURCE, 1], target)) - self._sizes[TARGET, 0])
        tilt = min(1.0, float(tilt_of(source)) / TILTED)
        return float(tilting(distance, tilt, self.verdict.held, self.verdict.target / self.count))


class TiltPourEnv(SingleMotionEnv[PourProgress], PourEnv):
    """Empty the glass in the hand into the one in front of it."""

    FACTS = TILT_POUR
    GOAL_BOUNDS = (1.0, 1.0)

    def __init__(
        self,
        robot: str = "Panda",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "ee_twist",
        reward: str = "dense",
        control_frequency: int = FREQUENCY,
        goal_form: bool = False,
        end_on_success: bool | None = None,
        render_mode: str | None = None,
    ):
        super().__init__(
            robot=robot,
            pregrasped=True,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            control_frequency=control_frequency,
            render_mode=render_mode,
        )
        self._take_form("tilt_pour", goal_form, end_on_success, obstacles=False)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        """Return a start with the stands as in pouring, and the source in the hand in front of the target."""
        check_known(options, OPTIONS)
        given = checked_stands(options["stands"], self._axis) if "stands" in options else None
        wanted = checked_joints(options["joint_positions"], self.arms) if "joint_positions" in options else None
        ranges, aside = RANGES[layout], ASIDE[layout]
        for _ in range(MAX_STARTS):
            tops = pour_layout(self.np_random, ranges, self._nominal, self._axis, GAP) if given is None else given
            shift = self.np_random.uniform(-aside, aside, 3)
            joints = self._before_target(tops, shift) if wanted is None else wanted
            if joints is not None and (wanted is not None or self._is_clear(tops, joints)):
                return self._holding_at(tops, joints)
        raise BadOption("stands", "the hand cannot be before the target, or not clear of the glasses, at the start")

    def _before_target(self, tops: np.ndarray, shift: np.ndarray) -> np.ndarray | None:
        """Return joints (1, dof) that hold the source in front of the target and can tilt it there, or None."""
        arm, glass = self.arms[0], self._glasses[SOURCE]
        rim = tops[TARGET] + [0.0, 0.0, self._glasses[TARGET].height]
        for turn in TURNS:
            yaw = self._yaw_at(rim, TARGET) + turn
            hand = Pose.from_position_quaternion(shift) @ pouring(glass, rim, yaw, 0.0, BACK, UP)
            q = holding_joints(arm, [hand], self._ready[0])
            if q is not None and can_follow(arm, q, [pouring(glass, rim, yaw, part * TILTED) for part in TILTS]):
                return q[None]
        return None

    def _holding_at(self, tops: np.ndarray, joints: np.ndarray) -> Start:
        glass, glasses = self._glasses[SOURCE], self._place(tops)
        glasses[SOURCE] = (self.arms[0].fk(joints[0]) @ tcp_from_glass(glass)).vector
        sizes = np.array([[each.radius, each.height] for each in self._glasses])
        self._progress = TiltProgress(glasses, sizes, BEADS.count, self.control_dt, in_hand=True)
        beads = poured_into(glasses[SOURCE], glass, BEADS)
        grips = np.array([2.0 * glass.radius - SQUEEZE])
        return Start(joints, glasses, self._furniture.copy(), beads, grips=grips)

    def achieved_goal(self, state: State) -> np.ndarray:
        """See `SingleMotionEnv`: (2,) shares of the beads in the target and outside both glasses."""
        return self._progress.fractions[1:].copy()

    def desired_goal(self) -> np.ndarray:
        """See `SingleMotionEnv`: (2,) all beads in the target and none outside."""
        return np.array([1.0, 0.0])

    def agreement(self, achieved: np.ndarray, desired: np.ndarray) -> Agreement:
        """See `SingleMotionEnv`: shares of missing and of spilled beads; more than desired costs nothing."""
        missing = np.maximum(desired[..., 0] - achieved[..., 0], 0.0)
        spilled = np.maximum(achieved[..., 1] - desired[..., 1], 0.0)
        reached = (missing <= 1.0 - ENOUGH + 1e-9) & (spilled <= SPILLED + 1e-9)
        return Agreement(near(0.2 * (missing + spilled)), reached)
