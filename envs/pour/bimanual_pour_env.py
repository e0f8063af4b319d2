"""Pouring with two arms, a glass in each hand."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadOption, told_apart
from ...planner.geometry.shapes import pack
from ..core import spaces as space
from ..core.environment import TaskEnv
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints
from ..scene.beads import poured_into
from ..scene.body_clearance import arm_clearance
from ..scene.robots import robot_named
from ..scene.scene_objects import Beads, Glass, SceneSpec
from ..simulation.render import View
from ..simulation.simulation import Start
from ..simulation.state import State
from .geometry import SOURCE, TARGET, level_hand
from .rules import PourProgress
from .skill import BIMANUAL_SKILL

ARMS = ("right", "left")
"""Names of the arms: the right hand holds the source, the left one the target."""
GLASSES = (Glass("source", radius=0.023, height=0.12), Glass("target", radius=0.027))
BEADS = Beads()
GRASP_HEIGHTS = (0.060, 0.045)
"""Heights of the fingers above the glasses' bottoms [m]."""
READY = (
    (-0.03, 0.32, 1.84, 1.34, 2.51, -0.63, -1.27),
    (0.14, 0.18, -1.44, 1.53, -0.11, 0.44, -1.25),
)
"""Baxter's joints [rad] that seed inverse kinematics: elbows out, wrists in front of the robot."""
PLACES = ((0.14, -0.22, 1.22), (0.22, 0.16, 1.18))
"""Nominal centers [m] of the glasses at the start."""
YAWS = np.deg2rad((60.0, -60.0))
"""Nominal approach directions [rad] of the level hands."""
TILT = 5.0
"""Largest tilt [degrees] of a hand with a glass in it at the start."""
OPTIONS = ("level", "obstacles", "joint_positions")
CLEARANCE, MARGIN = 0.03, 0.1
"""Least distance [m] of an arm at the start to the fixtures, and to its joint limits [rad]."""
APART = 0.22
"""Least distance of the glasses' axes at the start [m], so that both hands fit."""
MAX_STARTS = 500
VIEW = View((0.0, 0.0, 1.1), 2.0, 160.0, -15.0)


@dataclass(frozen=True, slots=True)
class BimanualPourRanges:
    """Ranges of a start around the nominal one.

    Attributes:
        place: largest shift of a glass in x, y and z [m].
        yaw: largest turn of a hand [rad].
        joints: largest change of a joint of the seed [rad].
    """

    place: float
    yaw: float
    joints: float


RANGES = {
    "L0": BimanualPourRanges(0.0, 0.0, 0.0),
    "L1": BimanualPourRanges(0.05, np.deg2rad(15.0), 0.05),
    "L2": BimanualPourRanges(0.15, np.deg2rad(60.0), 0.15),
}
"""Ranges by layout name, see `levels`; unreachable starts are drawn anew."""


class BimanualPourEnv(TaskEnv[PourProgress]):
    """Pour the beads of one glass into another, each held by one arm of Baxter from the start.

    ## Description
    The right hand holds the source (46 mm wide, 120 mm high, 80 g) with 30 beads of 12 mm and 1 g that represent
    water, the left hand the target (54 mm wide, 100 mm high). Only friction holds the glasses between the fingers,
    and the beads move by gravity. The place of pouring is free. Success is judged from the simulator: for half a
    second at least 90 % of the beads are in the target and at most 5 % outside both glasses, and the target is
    upright and at rest.

    ## Action Space
    `Box(-1, 1, (16,), float64)` at 50 Hz, right arm first; `(14,)` with `control_mode="ee_twist"`.

    | control mode | entry of each arm | meaning |
    |---|---|---|
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes. Poses are `x y z [m]`, then quaternion wxyz. A glass's frame is at the center of its
    axis, z up.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (2, 7) | [rad]; right arm, left arm |
    | `joint_velocities` | (2, 7) | [rad/s] |
    | `tcp_pose` | (2, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (2,) | gap between the finger pads [m] |
    | `object_pose` | (2, 7) | source and target |
    | `goal_pose` | (1, 7) | center of the target's rim at the start; constant during an episode |
    | `bead_fraction` | (3,) | share of the beads in the source, in the target, outside both |
    | `motion_index` | (1,) | 1 while the source is held, 2 while enough beads are poured |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |

    ## Rewards
    `reward="dense"`: in [0, 1], half of it the share of the beads in the target, the other half for holding the
    source and bringing it to the target, kept once beads are poured; 1 with success. `reward="sparse"`: 1 with
    success.

    ## Starting State
    The glasses are upright in the hands. By `level`: L0 the nominal places; L1 each glass moved by up to 5 cm in x, y
    and z and its hand turned by up to 15 degrees about the vertical; L2 by 15 cm and 60 degrees. A start is drawn
    anew if an arm cannot reach it from its ready posture with 0.1 rad to all joint limits and 3 cm to trunk and
    table, or if the glasses are less than 22 cm apart.

    L3, L4 and F are L2 with obstacles on the source's straight path to the target's initial place: see
    `onedemo/Pour-v0`. R, S and T start as L1 does.

    ## Episode End
    `terminated` with a settled success, when a glass has fallen, or when more than 5 % of the beads lie on the table
    or below. `truncated` after 40 s (Gymnasium's `TimeLimit`).

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far; contacts of an arm with itself are ignored), `stage`,
    `failure_reason`, `collision`, `n_contacts` (steps with an obstacle touched), `min_obstacle_distance` [m],
    `layouts_refused`, `fraction_in_target`, `fraction_outside`, `carry_tilt` [rad] (largest tilt of the source before
    its rim came within 15 cm of the target's axis) and `beads_lost` (most beads outside both glasses until then).

    ## Arguments
    `robot="Baxter"`, `level="L1"`, `obstacles=None` (those of the level) or `"none" | "static" | "appear" |
    "moving" | "unforeseen" | "forearm"`, `control_mode="joint_velocity" | "ee_twist"`, `reward="sparse" | "dense"`,
    `control_frequency=50`, `render_mode=None | "rgb_array" | "human"`. `reset(options=...)` takes `level`,
    `obstacles` (a kind, or a list of `ScheduledObstacle`) and `joint_positions` (2, 7), which must hold the
    glasses upright.

    ## Version History
    * v0: first version.
    """

    SKILL = BIMANUAL_SKILL

    def __init__(
        self,
        robot: str = "Baxter",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = 50,
        render_mode: str | None = None,
    ):
        kind = robot_named(robot)
        if tuple(kind.ready) != ARMS:
            raise BadOption("robot", f"{robot} has one arm; this task needs two: Baxter")
        for glass in GLASSES:
            kind.check_grip(2.0 * glass.radius, f"the {glass.name}")
        super().__init__(
            name="bimanual_pour",
            robot=kind,
            things=SceneSpec(GLASSES, (), BEADS),
            goals=1,
            motions=2,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            arms=ARMS,
            view=VIEW,
            more={"bead_fraction": space.box(0.0, 1.0, (3,))},
        )
        self._solids = pack(self.task.fixtures)
        self._place(np.array(READY))

    def _place(self, joints: np.ndarray) -> np.ndarray:
        """Take over the start joints (2, dof); return the poses (2, 7) of the glasses in the hands."""
        held = [
            (arm.fk(q) @ tcp_from_glass(k)).vector for k, (arm, q) in enumerate(zip(self.arms, joints, strict=True))
        ]
        glasses = np.array(held)
        rim = Pose.from_vector(glasses[TARGET]) @ Pose.from_position_quaternion([0, 0, 0.5 * GLASSES[TARGET].height])
        self._goal_pose = rim.vector[None]
        sizes = np.array([[glass.radius, glass.height] for glass in GLASSES])
        self._progress = PourProgress(glasses, sizes, BEADS.count, self.control_dt, in_hand=True)
        return glasses

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        joints = self._drawn(RANGES[layout])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], self.arms)
            for arm, q, side in zip(self.arms, joints, ARMS, strict=True):
                tilt = float(np.degrees(np.arccos(np.clip(arm.fk(q).rotation[2, 1], -1.0, 1.0))))
                if tilt > TILT:
                    found, most = told_apart(tilt, TILT, 0)
                    reason = f"the {side} hand is {found} degrees from level; {most} are possible with a glass in it"
                    raise BadOption("joint_positions", reason)
        glasses = self._place(joints)
        beads = poured_into(glasses[SOURCE], GLASSES[SOURCE], BEADS)
        return Start(joints, glasses, beads=beads, grips=np.array([2.0 * glass.radius for glass in GLASSES]))

    def _drawn(self, ranges: BimanualPourRanges) -> np.ndarray:
        """Draw start joints (2, dof) by rejection, by reach alone, independent of any method."""
        rng = self.np_random
        for _ in range(MAX_STARTS):
            places = np.array(PLACES) + rng.uniform(-ranges.place, ranges.place, (2, 3))
            yaws = YAWS + rng.uniform(-ranges.yaw, ranges.yaw, 2)
            seeds = np.array(READY) + rng.uniform(-ranges.joints, ranges.joints, (2, self.arms[0].dof))
            if np.hypot(*(places[0] - places[1])[:2]) < APART:
                continue
            found = [self._reachable(k, places[k], yaws[k], seeds[k]) for k in range(2)]
            if found[0] is not None and found[1] is not None:
                return np.array(found)
        raise BadOption("level", "no start was found that both arms can reach")

    def _reachable(self, k: int, place: np.ndarray, yaw: float, seed: np.ndarray) -> np.ndarray | None:
        """Return joints (dof,) of arm k that hold its glass at a place, or None."""
        arm = self.arms[k]
        rise = np.array([0.0, 0.0, GRASP_HEIGHTS[k] - 0.5 * GLASSES[k].height])
        hand = level_hand(place + rise, yaw)
        q = inverse_kinematics(arm, hand, seed)
        if q is None or arm.margin(q) < MARGIN:
            return None
        clearance = arm_clearance(arm, self._task.bodies[k], q, self._solids, range(1, arm.dof))
        return q if clearance >= CLEARANCE else None

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the motion of the source to the target's initial place."""
        hand = self.arms[0].fk(start.joints[0])
        above = Pose.from_position_quaternion(self._goal_pose[0, :3] + [0.0, 0.0, 0.5 * GLASSES[SOURCE].height])
        turned = Pose.from_position_quaternion([0, 0, 0], hand.quaternion)
        before = above @ turned @ Pose.from_position_quaternion([0.0, 0.0, -0.1])
        return [
            PlacementMotion(hand, before, ((hand,), (before,)), GLASSES[SOURCE].shape, tcp_from_glass(SOURCE), motion=1)
        ]

    def _more_observed(self, state: State) -> dict[str, np.ndarray]:
        return {"bead_fraction": self._progress.fractions}


def tcp_from_glass(k: int) -> Pose:
    """Return the pose of glass k in its hand: the axis between the pads, along the tcp's y."""
    return level_hand(np.array([0.0, 0.0, GRASP_HEIGHTS[k] - 0.5 * GLASSES[k].height]), 0.0).inverse()
