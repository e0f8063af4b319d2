"""Pouring with two arms, a glass in each hand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadOption, told_apart
from ...planner.geometry.shapes import pack
from ..core import spaces as space
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.maker import EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints
from ..scene.beads import poured_into
from ..scene.body_clearance import arm_clearance
from ..scene.robots import robot_named
from ..scene.scene_objects import Beads, Glass, SceneSpec
from ..simulation.render import View
from ..simulation.simulation import Start
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


class BimanualPouring(DeclaredTask):
    """Pouring with two arms.

    Args:
        robot: name of the robot.
    """

    facts, name, goals, motions, view = BIMANUAL_POUR, BIMANUAL_POUR.name, 1, 2, VIEW
    things, arms = SceneSpec(GLASSES, (), BEADS), ARMS
    more: Mapping[str, Any] = {"bead_fraction": space.box(0.0, 1.0, (3,))}

    def __init__(self, robot: str = "Baxter"):
        self.robot = robot_named(robot)
        if tuple(self.robot.ready) != ARMS:
            raise BadOption("robot", f"{robot} has one arm; this task needs two: Baxter")
        for glass in GLASSES:
            self.robot.check_grip(2.0 * glass.radius, f"the {glass.name}")

    def bind(self, world: World) -> None:
        """See `DeclaredTask`."""
        self.solids = pack(world.task.fixtures)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        joints = self._drawn(world, RANGES[layout])
        if "joint_positions" in options:
            joints = checked_joints(options["joint_positions"], world.arms)
            for arm, q, side in zip(world.arms, joints, ARMS, strict=True):
                tilt = float(np.degrees(np.arccos(np.clip(arm.fk(q).rotation[2, 1], -1.0, 1.0))))
                if tilt > TILT:
                    found, most = told_apart(tilt, TILT, 0)
                    reason = f"the {side} hand is {found} degrees from level; {most} are possible with a glass in it"
                    raise BadOption("joint_positions", reason)
        held = [arm.fk(q) @ tcp_from_glass(k) for k, (arm, q) in enumerate(zip(world.arms, joints, strict=True))]
        glasses, sizes = np.array([pose.vector for pose in held]), [[each.radius, each.height] for each in GLASSES]
        rim = Pose.from_vector(glasses[TARGET]) @ Pose.from_position_quaternion([0, 0, 0.5 * GLASSES[TARGET].height])
        progress = PourProgress(glasses, np.array(sizes), BEADS.count, world.dt, in_hand=True)
        beads = poured_into(glasses[SOURCE], GLASSES[SOURCE], BEADS)
        start = Start(joints, glasses, beads=beads, grips=np.array([2.0 * glass.radius for glass in GLASSES]))
        return TaskEpisode(start, rim.vector[None], progress)

    def _drawn(self, world: World, ranges: BimanualPourRanges) -> np.ndarray:
        """Draw start joints (2, dof) by rejection, by reach alone, independent of any method."""
        rng = world.rng
        for _ in range(MAX_STARTS):
            places = np.array(PLACES) + rng.uniform(-ranges.place, ranges.place, (2, 3))
            yaws = YAWS + rng.uniform(-ranges.yaw, ranges.yaw, 2)
            seeds = np.array(READY) + rng.uniform(-ranges.joints, ranges.joints, (2, world.arms[0].dof))
            if np.hypot(*(places[0] - places[1])[:2]) < APART:
                continue
            found = [self._reachable(world, k, places[k], yaws[k], seeds[k]) for k in range(2)]
            if found[0] is not None and found[1] is not None:
                return np.array(found)
        raise BadOption("level", "no start was found that both arms can reach")

    def _reachable(self, world: World, k: int, place: np.ndarray, yaw: float, seed: np.ndarray) -> np.ndarray | None:
        """Return joints (dof,) of arm k that hold its glass at a place, or None."""
        arm = world.arms[k]
        rise = np.array([0.0, 0.0, GRASP_HEIGHTS[k] - 0.5 * GLASSES[k].height])
        hand = level_hand(place + rise, yaw)
        q = inverse_kinematics(arm, hand, seed)
        if q is None or arm.margin(q) < MARGIN:
            return None
        clearance = arm_clearance(arm, world.task.bodies[k], q, self.solids, range(1, arm.dof))
        return q if clearance >= CLEARANCE else None

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`: the motion of the source to the target's initial place."""
        hand = world.arms[0].fk(episode.start.joints[0])
        above = Pose.from_position_quaternion(episode.goals[0, :3] + [0.0, 0.0, 0.5 * GLASSES[SOURCE].height])
        turned = Pose.from_position_quaternion([0, 0, 0], hand.quaternion)
        before = above @ turned @ Pose.from_position_quaternion([0.0, 0.0, -0.1])
        return [
            PlacementMotion(hand, before, ((hand,), (before,)), GLASSES[SOURCE].shape, tcp_from_glass(SOURCE), motion=1)
        ]

    def observed(self, episode: TaskEpisode) -> dict[str, np.ndarray]:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, PourProgress)
        return {"bead_fraction": episode.progress.fractions}


def tcp_from_glass(k: int) -> Pose:
    """Return the pose of glass k in its hand: the axis between the pads, along the tcp's y."""
    return level_hand(np.array([0.0, 0.0, GRASP_HEIGHTS[k] - 0.5 * GLASSES[k].height]), 0.0).inverse()


bimanual_pour_env = EnvironmentMaker(BimanualPouring)
