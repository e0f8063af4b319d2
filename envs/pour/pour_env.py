"""Pouring beads from one glass into another."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Obstacle, Pose
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.errors import BadOption
from ...planner.geometry.shapes import pack
from ...planner.robot.kinematics import CHAIN
from ..core import spaces as space
from ..core.environment import TaskEnv
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints
from ..scene.beads import poured_into
from ..scene.body_clearance import arm_clearance
from ..scene.robots import places_of, robot_named
from ..scene.scene_objects import SceneSpec
from ..simulation.render import View
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import POUR, SOURCE, TARGET
from .geometry import BACK, BEADS, GLASSES, STANDS, TILTED, UP, grasp, pouring, tcp_from_glass
from .layout import GAP, LONG_GAP, RANGES, checked_stands, pour_layout
from .places import POUR_PLACES
from .rules import PourProgress

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
VIEW = View((-0.14, -0.02, 1.06), 1.42, 150.0, -17.0)


class PourEnv(TaskEnv[PourProgress]):
    """Pour the beads of one glass into another with one arm."""

    FACTS = POUR

    def __init__(
        self,
        robot: str = "Panda",
        pregrasped: bool = False,
        stands: Any = None,
        ready: Any = None,
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = 50,
        render_mode: str | None = None,
    ):
        if not isinstance(pregrasped, bool):
            raise BadOption("pregrasped", f"{pregrasped!r} is neither True nor False")
        kind = robot_named(robot)
        places = places_of(POUR_PLACES, kind, "pour")
        kind.check_grip(2.0 * places.source.radius, "the source")
        self._glasses = (places.source, GLASSES[TARGET])
        super().__init__(
            name="pour",
            robot=kind,
            things=SceneSpec(self._glasses, STANDS, BEADS),
            goals=1,
            motions=2,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            view=VIEW,
            more={"furniture_pose": space.pose_box(2), "bead_fraction": space.box(0.0, 1.0, (3,))},
        )
        self.pregrasped = pregrasped
        self._nominal = checked_stands(places.stands if stands is None else stands, self._axis)
        self._ready = checked_joints(places.ready if ready is None else ready, self.arms)
        self._place(self._nominal)

    @property
    def _axis(self) -> np.ndarray:
        return self.arms[0].chain[0, CHAIN.offset : CHAIN.offset + 2]

    def _place(self, stands: np.ndarray) -> np.ndarray:
        """Take over the tops (2, 3) of the stands; return the poses (2, 7) of the glasses on them."""
        upright = np.tile([1.0, 0.0, 0.0, 0.0], (2, 1))
        heights = np.array([[0.0, 0.0, glass.height] for glass in self._glasses])
        self._furniture = np.column_stack([stands, upright])
        self._goal_pose = np.append(stands[TARGET] + heights[TARGET], upright[0])[None]
        glasses = np.column_stack([stands + 0.5 * heights, upright])
        sizes = np.array([[glass.radius, glass.height] for glass in self._glasses])
        self._progress = PourProgress(glasses, sizes, BEADS.count, self.control_dt)
        return glasses

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        given = checked_stands(options["stands"], self._axis) if "stands" in options else None
        wanted = checked_joints(options["joint_positions"], self.arms) if "joint_positions" in options else None
        ranges = RANGES[layout]
        gap = LONG_GAP if spacious and ranges.source else GAP
        for _ in range(MAX_STARTS):
            tops = pour_layout(self.np_random, ranges, self._nominal, self._axis, gap) if given is None else given
            offsets = self.np_random.uniform(-ranges.joints, ranges.joints, self._ready.shape)
            joints = self._joints(tops, offsets) if wanted is None else wanted
            if joints is not None and (given is not None or wanted is not None or self._is_clear(tops, joints)):
                return self._started_at(tops, joints)
        raise BadOption("stands", "the hand cannot be at the source, or not clear of the glasses, at the start")

    def _started_at(self, tops: np.ndarray, joints: np.ndarray) -> Start:
        glasses = self._place(tops)
        beads = poured_into(glasses[SOURCE], self._glasses[SOURCE], BEADS)
        grips = np.array([2.0 * self._glasses[SOURCE].radius]) if self.pregrasped else None
        return Start(joints, glasses, self._furniture.copy(), beads, grips=grips)

    def _joints(self, tops: np.ndarray, offsets: np.ndarray) -> np.ndarray | None:
        """Return start joints (1, dof): near the ready ones, or holding the source; None if no joints hold it."""
        arm = self.arms[0]
        if not self.pregrasped:
            return np.clip(self._ready + offsets, arm.lower, arm.upper)
        center = tops[SOURCE] + [0.0, 0.0, 0.5 * self._glasses[SOURCE].height]
        approach = arm.fk(self._ready[0]).rotation[:2, 2]
        yaw = np.arctan2(approach[1], approach[0])
        for turn in TURNS:
            q = inverse_kinematics(arm, grasp(self._glasses[SOURCE], center, yaw + turn), self._ready[0])
            if q is not None and arm.margin(q) >= MARGIN:
                return q[None]
        return None

    def _is_clear(self, tops: np.ndarray, joints: np.ndarray) -> bool:
        """Return whether the arm keeps its distance from the objects that it does not hold."""
        solids = []
        for k in range(int(self.pregrasped), 2):
            at = Pose.from_position_quaternion(tops[k])
            top = Pose.from_position_quaternion([0.0, 0.0, 0.5 * self._glasses[k].height])
            solids += [*self._task.furniture[k].at(at), Obstacle(self._glasses[k].shape, at @ top)]
        return arm_clearance(self.arms[0], self._task.bodies[0], joints[0], pack(solids)) >= START_CLEARANCE

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the carry: from above the source's stand to in front of the target, turned with the arm."""
        glass, rim, center = self._glasses[SOURCE], self._goal_pose[0, :3], start.objects[SOURCE, :3]
        hand = grasp(glass, center, self._yaw_at(center, SOURCE))
        yaw = self._yaw_at(rim, TARGET)
        above = [Pose.from_position_quaternion([0.0, 0.0, up]) @ hand for up in (*ABOVE, RAISED)]
        before, after = pouring(glass, rim, yaw, 0.0, BACK, UP), pouring(glass, rim, yaw, TILTED)
        keys = tuple((pose,) for pose in (*above[:-1], before, after))
        return [PlacementMotion(above[-1], before, keys, glass.shape, tcp_from_glass(glass), motion=1)]

    def _yaw_at(self, place: np.ndarray, glass: int) -> float:
        """Return a level hand's direction [rad]: the ready one, turned about the arm's base like the glass's place."""
        approach = self.arms[0].fk(self._ready[0]).rotation[:2, 2]
        was, now = self._nominal[glass, :2] - self._axis, place[:2] - self._axis
        turned = np.arctan2(now[1], now[0]) - np.arctan2(was[1], was[0])
        return float(np.arctan2(approach[1], approach[0]) + turned)

    def _more_observed(self, state: State) -> dict[str, np.ndarray]:
        return {"furniture_pose": self._furniture.copy(), "bead_fraction": self._progress.fractions}
