"""Pouring beads from one glass into another."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from ...planner import Obstacle, Pose
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadOption
from ...planner.geometry.shapes import pack
from ...planner.robot.kinematics import CHAIN
from ..core import spaces as space
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.maker import EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints
from ..scene.beads import poured_into
from ..scene.body_clearance import arm_clearance
from ..scene.robots import places_of, robot_named
from ..scene.scene_objects import SceneSpec
from ..simulation.render import View
from ..simulation.simulation import Start
from .facts import POUR, SOURCE, TARGET
from .geometry import BACK, BEADS, GLASSES, STANDS, TILTED, UP, grasp, pouring, tcp_from_glass
from .layout import GAP, LONG_GAP, RANGES, checked_stands, pour_layout
from .places import POUR_PLACES
from .rules import PourProgress, tilted_over

OPTIONS = ("level", "obstacles", "stands", "joint_positions")
RAISED, ABOVE = 0.12, (0.0, 0.04, 0.08)
"""Heights [m] above the grasp: of the start of the carry, and those at which the hand must have clearance from
obstacles."""
START_CLEARANCE = 0.03
"""Least distance [m] of the arm at the start to glasses and stands, the held glass and its stand excepted."""
TURNS = np.deg2rad((0.0, 15.0, -15.0, 30.0, -30.0, 45.0, -45.0))
"""Turns [rad] from the ready direction of a hand that holds the source from the start; the first that fits is used."""
MARGIN = 0.1
"""Least distance of a joint to its limit [rad] for starts with the source in the hand."""
MAX_STARTS = 200
UPRIGHT_TWO = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
"""Rotations (2, 4) of what stands, wxyz."""
VIEW = View((-0.14, -0.02, 1.06), 1.42, 150.0, -17.0)


class Pouring(DeclaredTask):
    """Pouring with one arm.

    Args:
        robot: name of the robot.
        pregrasped: whether the fingers are closed around the source at the start.
        stands: (2, 3) nominal tops of the stands [m]; None: the robot's own.
        ready: (7,) nominal start joints [rad]; None: the robot's own.
    """

    facts, name, goals, motions, view = POUR, POUR.name, 1, 2, VIEW
    more: Mapping[str, Any] = {"furniture_pose": space.pose_box(2), "bead_fraction": space.box(0.0, 1.0, (3,))}

    def __init__(self, robot: str = "Panda", pregrasped: bool = False, stands: Any = None, ready: Any = None):
        if not isinstance(pregrasped, bool):
            raise BadOption("pregrasped", f"{pregrasped!r} is neither True nor False")
        self.robot = robot_named(robot)
        self.places = places_of(POUR_PLACES, self.robot, "pour")
        self.robot.check_grip(2.0 * self.places.source.radius, "the source")
        self.glasses = (self.places.source, GLASSES[TARGET])
        self.things, self.pregrasped = SceneSpec(self.glasses, STANDS, BEADS), pregrasped
        self.given = (self.places.stands if stands is None else stands, self.places.ready if ready is None else ready)

    def bind(self, world: World) -> None:
        """See `DeclaredTask`."""
        self.axis = world.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]
        self.nominal = checked_stands(self.given[0], self.axis)
        self.ready = checked_joints(self.given[1], world.arms)

    def standing(self, tops: np.ndarray) -> np.ndarray:
        """Return the poses (2, 7) of the glasses on stands with tops (2, 3)."""
        heights = np.array([[0.0, 0.0, glass.height] for glass in self.glasses])
        return np.column_stack([tops + 0.5 * heights, UPRIGHT_TWO])

    def episode(
        self, world: World, joints: np.ndarray, tops: np.ndarray, *, held: np.ndarray | None = None, grip: float | None
    ) -> TaskEpisode:
        """Return an episode with the glasses on their stands, or with the source in the hand.

        Args:
            world: the task's world.
            joints: (1, dof) start joints [rad].
            tops: (2, 3) tops of the stands [m].
            held: (7,) pose of a source in the hand; None: it stands.
            grip: opening [m] of fingers that hold the source; None: they are open.
        """
        glasses, rim = self.standing(tops), tops[TARGET] + [0.0, 0.0, self.glasses[TARGET].height]
        if held is not None:
            glasses[SOURCE] = held
        sizes = np.array([[glass.radius, glass.height] for glass in self.glasses])
        dense = None if held is None else tilted_over
        progress = PourProgress(glasses, sizes, BEADS.count, world.dt, in_hand=held is not None, dense=dense)
        beads, stands = poured_into(glasses[SOURCE], self.glasses[SOURCE], BEADS), np.column_stack([tops, UPRIGHT_TWO])
        grips = None if grip is None else np.array([grip])
        start = Start(joints, glasses, stands.copy(), beads, grips=grips)
        return TaskEpisode(start, np.append(rim, UPRIGHT_TWO[0])[None], progress, {"furniture_pose": stands})

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        given = checked_stands(options["stands"], self.axis) if "stands" in options else None
        wanted = checked_joints(options["joint_positions"], world.arms) if "joint_positions" in options else None
        ranges = RANGES[layout]
        gap = LONG_GAP if spacious and ranges.source else GAP
        for _ in range(MAX_STARTS):
            tops = pour_layout(world.rng, ranges, self.nominal, self.axis, gap) if given is None else given
            offsets = world.rng.uniform(-ranges.joints, ranges.joints, self.ready.shape)
            joints = self._joints(world, tops, offsets) if wanted is None else wanted
            if joints is not None and (given is not None or wanted is not None or self.is_clear(world, tops, joints)):
                grip = 2.0 * self.glasses[SOURCE].radius if self.pregrasped else None
                return self.episode(world, joints, tops, grip=grip)
        raise BadOption("stands", "the hand cannot be at the source, or not clear of the glasses, at the start")

    def _joints(self, world: World, tops: np.ndarray, offsets: np.ndarray) -> np.ndarray | None:
        """Return start joints (1, dof): near the ready ones, or holding the source; None if no joints hold it."""
        arm = world.arms[0]
        if not self.pregrasped:
            return np.clip(self.ready + offsets, arm.lower, arm.upper)
        center = tops[SOURCE] + [0.0, 0.0, 0.5 * self.glasses[SOURCE].height]
        approach = arm.fk(self.ready[0]).rotation[:2, 2]
        yaw = np.arctan2(approach[1], approach[0])
        for turn in TURNS:
            q = inverse_kinematics(arm, grasp(self.glasses[SOURCE], center, yaw + turn), self.ready[0])
            if q is not None and arm.margin(q) >= MARGIN:
                return q[None]
        return None

    def is_clear(self, world: World, tops: np.ndarray, joints: np.ndarray) -> bool:
        """Return whether the arm keeps its distance from the objects that it does not hold.

        Args:
            world: the task's world.
            tops: (2, 3) tops of the stands [m].
            joints: (1, dof) joints [rad].
        """
        solids = []
        for k in range(int(self.pregrasped), 2):
            at = Pose.from_position_quaternion(tops[k])
            top = Pose.from_position_quaternion([0.0, 0.0, 0.5 * self.glasses[k].height])
            solids += [*world.task.furniture[k].at(at), Obstacle(self.glasses[k].shape, at @ top)]
        return arm_clearance(world.arms[0], world.task.bodies[0], joints[0], pack(solids)) >= START_CLEARANCE

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`: from above the source's stand to in front of the target, turned with the arm."""
        glass, rim, center = self.glasses[SOURCE], episode.goals[0, :3], episode.start.objects[SOURCE, :3]
        hand = grasp(glass, center, self.yaw_at(world, center, SOURCE))
        yaw = self.yaw_at(world, rim, TARGET)
        above = [Pose.from_position_quaternion([0.0, 0.0, up]) @ hand for up in (*ABOVE, RAISED)]
        before, after = pouring(glass, rim, yaw, 0.0, BACK, UP), pouring(glass, rim, yaw, TILTED)
        keys = tuple((pose,) for pose in (*above[:-1], before, after))
        return [PlacementMotion(above[-1], before, keys, glass.shape, tcp_from_glass(glass), motion=1)]

    def yaw_at(self, world: World, place: np.ndarray, glass: int) -> float:
        """Return a level hand's direction [rad]: the ready one, turned about the arm's base like the glass's place.

        Args:
            world: the task's world.
            place: (3,) place of the glass, or above it [m].
            glass: index of the glass.
        """
        approach = world.arms[0].fk(self.ready[0]).rotation[:2, 2]
        was, now = self.nominal[glass, :2] - self.axis, place[:2] - self.axis
        turned = np.arctan2(now[1], now[0]) - np.arctan2(was[1], was[0])
        return float(np.arctan2(approach[1], approach[0]) + turned)

    def observed(self, episode: TaskEpisode) -> dict[str, np.ndarray]:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, PourProgress)
        return {**super().observed(episode), "bead_fraction": episode.progress.fractions}


pour_env = EnvironmentMaker(Pouring)
