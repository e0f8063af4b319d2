"""Pouring with the source in the hand, in front of the target."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.dense_reward import near, tilting
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.reset_options import check_known, checked_joints
from ..core.single_motion import FREQUENCY, Agreement, SingleMotionEnv
from ..scene.beads import poured_into
from ..simulation.simulation import Start
from ..simulation.state import State
from .geometry import BACK, BEADS, SOURCE, TARGET, TILTED, UP, pouring, tcp_from_glass
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
    """Empty the glass in the hand into the one in front of it.

    ## Description
    The source glass, with 30 beads of 12 mm and 1 g that represent water, is in the hand, upright, in front of and
    above the target glass, held only by friction between the fingers. It must be tilted so that the beads fall into
    the target. Success is judged from the simulator as in `onedemo/Pour-v0`: for half a second at least 90 % of the
    beads are in the target and at most 5 % outside both glasses, and the target is upright and at rest.

    ## Action Space
    `Box(-1, 1, (7,), float64)` at 20 Hz; `(8,)` with `control_mode="joint_velocity"` for an arm of seven joints.

    | control mode | entry | meaning |
    |---|---|---|
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes; the first axis counts arms or objects. Poses are `x y z [m]`, then quaternion wxyz.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (2, 7) | source and target; a glass's frame is at the center of its axis, z up |
    | `goal_pose` | (1, 7) | center of the target's rim at the start; constant during an episode |
    | `furniture_pose` | (2, 7) | stands of source and target; constant during an episode |
    | `bead_fraction` | (3,) | share of the beads in the source, in the target, outside both |
    | `motion_index` | (1,) | 1 while the source is held, 2 while enough beads are poured, 0 once it is released |
    | `obstacle_active` | (3,) | 0: there is no obstacle |
    | `obstacle_shape` | (3,) | 0 |
    | `obstacle_size` | (3, 3) | 0 |
    | `obstacle_pose` | (3, 7) | 0 |
    | `obstacle_velocity` | (3, 3) | 0 |
    | `last_action` | that of the action | last action; zeros at the start |

    With `goal_form=True` the keys are `observation` (all of the above except `goal_pose` and `motion_index`, as one
    vector), `achieved_goal` and `desired_goal`
    (2,): shares of the beads in the target and outside both glasses; 1 and 0.
    `compute_reward(achieved, desired, info)` accepts one goal or many. Stable-Baselines3's HER works with it.

    ## Rewards
    `reward="dense"` (default): in [0, 1], half of it the share of the beads in the target, the other half for holding
    the source over the target and tilting it there. `reward="sparse"`: 1 with success, else 0.

    ## Starting State
    By `level`: the target stands as in `onedemo/Pour-v0`, moved by up to 10 cm (L1) or 20 cm and 10 to 30 cm high (L2);
    the source's lip is 6 cm behind the pour point and 8 cm above it, moved by up to 3 cm (L1) or 6 cm (L2) in x, y and
    z. L0 is the nominal place; R, S and T start as L1 does. The motion is too short for obstacles: L3, L4 and F do
    not exist.

    ## Episode End
    `terminated` when a glass has fallen off the table, or when more than 5 % of the beads lie on it or below.
    `truncated` after 150 actions, 7.5 s at 20 Hz (Gymnasium's `TimeLimit`: give `max_episode_steps` with another
    `control_frequency`). A settled success ends the episode with
    `end_on_success=True`, the default of `reward="sparse"`; with dense rewards, which are never negative, an early end
    would pay less than waiting beside the goal, so there and in the goal form the episode continues.

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts`, `min_obstacle_distance` [m], `layouts_refused`, `fraction_in_target`, `fraction_outside`,
    `carry_tilt` [rad], `beads_lost`.

    ## Arguments
    `robot="Panda"` (Baxter and every robot of `onedemo/Pour-v0`), `level="L1"`, `obstacles=None` or `"none"`,
    `control_mode="ee_twist" | "joint_velocity"`, `reward="dense" | "sparse"`, `control_frequency=20` (10, 20, 25 or 50:
    any that divides 500), `goal_form=False`, `end_on_success=None`, `render_mode=None | "rgb_array" | "human"`.
    `reset(options=...)` takes `level`, `stands` (2, 3) exact tops of the stands, and `joint_positions` (7,), which the
    glass follows.

    ## Version History
    * v0: first version.
    """

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
