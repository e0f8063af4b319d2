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
from .facts import BIMANUAL_POUR, SOURCE, TARGET
from .geometry import level_hand
from .rules import PourProgress

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
    """Pour the beads of one glass into another, each held by one arm of Baxter from the start."""

    FACTS = BIMANUAL_POUR

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
