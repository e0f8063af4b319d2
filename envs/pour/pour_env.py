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
from .geometry import BACK, BEADS, GLASSES, SOURCE, STANDS, TARGET, TILTED, UP, grasp, pouring, tcp_from_glass
from .layout import GAP, LONG_GAP, RANGES, checked_stands, pour_layout
from .places import POUR_PLACES
from .rules import PourProgress
from .skill import POUR_SKILL

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
    """Pour the beads of one glass into another with one arm.

    ## Description
    Two glasses stand on stands on a table: the source (60 mm wide, 100 mm high, 80 g; 46 mm wide for grippers that
    hold or clear no wider one) with 30 beads of 12 mm and 1 g that represent water, and the target (86 mm wide, 100 mm
    high). The source must be fetched, carried and emptied into the target. Only friction holds it between the fingers,
    and the beads move by gravity. Success is judged from the simulator: for half a second at least 90 % of the beads
    are in the target and at most 5 % outside both glasses, and the target is upright and at rest.

    ## Action Space
    `Box(-1, 1, (8,), float64)` for an arm of seven joints, at 50 Hz; `(7,)` with `control_mode="ee_twist"`.

    | control mode | entry | meaning |
    |---|---|---|
    | `joint_velocity` | 0 to 6 | joint speed as a fraction of the joint's limit |
    | `ee_twist` | 0 to 2 | velocity of the tcp in world axes as a fraction of 0.25 m/s |
    | `ee_twist` | 3 to 5 | angular velocity of the tcp in world axes as a fraction of 1.2 rad/s |
    | both | last | gripper: above 0 closes it, below 0 opens it to that fraction of its width, 0 leaves it unchanged |

    ## Observation Space
    A `Dict` of float64 boxes. Poses are `x y z [m]`, then quaternion wxyz. A glass's frame is at the center of its
    axis, z up; a stand's is at the center of its top.

    | key | shape | meaning |
    |---|---|---|
    | `joint_positions` | (1, 7) | [rad] |
    | `joint_velocities` | (1, 7) | [rad/s] |
    | `tcp_pose` | (1, 7) | point between the finger pads; fingers close along its x, the hand points along its z |
    | `gripper_opening` | (1,) | gap between the finger pads [m] |
    | `object_pose` | (2, 7) | source and target |
    | `goal_pose` | (1, 7) | center of the target's rim at the start; constant during an episode |
    | `furniture_pose` | (2, 7) | stands of source and target; constant during an episode |
    | `bead_fraction` | (3,) | share of the beads in the source, in the target, outside both |
    | `motion_index` | (1,) | 0 while the source is to be fetched, 1 while it is held, 2 while enough beads are poured |
    | `obstacle_active` | (3,) | 1 for a present obstacle; all entries of absent ones are 0 |
    | `obstacle_shape` | (3,) | 1 sphere, 2 box, 3 capsule |
    | `obstacle_size` | (3, 3) | box: extents; capsule: radius, radius, length of its segment; sphere: radius |
    | `obstacle_pose` | (3, 7) | poses of the obstacles |
    | `obstacle_velocity` | (3, 3) | velocities of their centers [m/s] |

    ## Rewards
    `reward="dense"`: in [0, 1], half of it the share of the beads in the target, the other half for reaching,
    holding and carrying the source, kept once beads are poured; 1 with success. `reward="sparse"`: 1 with success.

    ## Starting State
    By `level`: L0 the robot's nominal places; L1 the source moved by up to 5 cm and the target by up to 10 cm in x and
    y, start joints by up to 0.05 rad; L2 by 15 cm, 20 cm and 0.15 rad, each stand 10 to 30 cm high instead of 15. The
    glasses' axes are at least 20 cm apart and 0.35 to 0.72 m from the arm's base axis, the arm at least 3 cm from
    everything. No yaw is drawn: a round glass has none. With `pregrasped=True` the
    fingers are closed around the source on its stand.

    L3, L4 and F are L2 with obstacles: L3 has one to three static ones of 3 to 10 cm on the source's path from its
    stand to the target, L4 one that swings across the path at up to 0.3 m/s or appears during the carry, F a static
    one where the forearm passes. R, S and T start as L1 does. Obstacles are solid. They overlap the volume that hand
    and glass sweep on the straight path, and leave clearance at the start, at the grasp and while pouring.

    ## Episode End
    `terminated` with a settled success, when a glass has fallen off the table, or when more than 5 % of the beads lie
    on the table or below. `truncated` after 40 s (Gymnasium's `TimeLimit`).

    ## Info
    `is_success`, `success`, `safe` (no unwanted contact so far), `stage`, `failure_reason`, `collision`,
    `n_contacts` (steps with an obstacle touched), `min_obstacle_distance` [m] (smallest so far, of the whole arm and
    the held object), `layouts_refused` (starts that had no space for the obstacles), `fraction_in_target`,
    `fraction_outside`, `carry_tilt` [rad] (largest tilt of the lifted source before its rim came within 15 cm of the
    target's axis) and `beads_lost` (most beads outside both glasses until then).

    ## Arguments
    `robot="Panda"` (others: `onedemo.envs.pour.places.POUR_PLACES`; Baxter's right arm), `pregrasped=False`,
    `stands=None` or (2, 3) nominal x, y, z [m] of the stands' tops, source first, `ready=None` or (7,) nominal start
    joints [rad], `level="L1"`, `obstacles=None` (those of the level) or `"none" | "static" | "appear" | "moving" |
    "unforeseen" | "forearm"`, `control_mode="joint_velocity" | "ee_twist"`, `reward="sparse" | "dense"`,
    `control_frequency=50`, `render_mode=None | "rgb_array" | "human"`. `reset(options=...)` takes `level`, `obstacles`
    (a kind, or a list of `ScheduledObstacle`), `stands` (2, 3) exact tops of the stands, and `joint_positions` (7,).

    ## Version History
    * v0: first version.
    """

    SKILL = POUR_SKILL

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
