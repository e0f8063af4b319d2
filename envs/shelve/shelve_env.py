"""Shelving books in a cluttered cupboard."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Box, Obstacle, Pose
from ...planner.errors import BadOption
from ...planner.geometry.shapes import pack
from ..core.environment import MAX_LAYOUTS, Observation, TaskEnv
from ..core.placement_context import ObstacleRequest, PlacementMotion
from ..core.reset_options import check_known, checked_choice, checked_joints
from ..core.spaces import pose_box
from ..judge.goal_progress import GoalProgress
from ..scene.body_clearance import arm_clearance
from ..scene.robots import places_of, robot_named
from ..scene.scene_objects import SceneSpec
from ..simulation.render import Ghost, View
from ..simulation.simulation import Start
from ..simulation.state import State
from .facts import SHELVE
from .layout import MOST_BOOKS, RANGES, ShelfLayout, shelf_layout
from .options import OPTIONS, given_layout
from .parts import BOOK_SIZE, SHELVES, books, cupboard, stand
from .places import SHELF_PLACES
from .rules import hand_over, shelve_rules

VIEW = View(look_at=(-0.05, -0.06, 1.13), distance=1.4, azimuth=98.0, elevation=-17.0)
LIFT, INSERTION_DEPTH = 0.15, 0.22
"""Height of the hand above the stand, and distance in front of the slot, at the ends of a carry [m]."""
GRASP = Pose.from_position_quaternion([0.025 - 0.5 * BOOK_SIZE[0], 0.0, 0.0], (0.5, 0.5, 0.5, 0.5))
"""Tcp pose in the frame of a book held by the spine, 25 mm deep, fingers on its covers."""
SPREAD = 0.15
"""Largest offset of obstacles from the hand's path [m]: book and hand sweep far more than the path itself, which is
so short that an obstacle right on it would also block the hand in front of the slot."""
START_CLEARANCE = 0.03
"""Least distance of the robot to the first book at the start [m]."""
CLEAR = 0.08
"""Least distance of the robot to the stand while a book is put there [m]."""
PAPER_SIZES = (0.06, 0.09)
"""Sizes of the obstacles that appear while the second and the third book are placed [m]."""


class ShelveEnv(TaskEnv[GoalProgress]):
    """Shelve three books in the upper shelf of a cluttered cupboard, with one arm."""

    FACTS = SHELVE

    def __init__(
        self,
        robot: str = "Panda",
        n_books: int = 3,
        shelf: str = "upper",
        level: str = "L1",
        obstacles: str | None = None,
        control_mode: str = "joint_velocity",
        reward: str = "sparse",
        control_frequency: int = 50,
        render_mode: str | None = None,
    ):
        if isinstance(n_books, bool) or not isinstance(n_books, int) or not 1 <= n_books <= MOST_BOOKS:
            raise BadOption("n_books", f"{n_books!r} is not a whole number from 1 to {MOST_BOOKS}")
        self.n_books, self.shelf = n_books, checked_choice("shelf", shelf, tuple(SHELVES))
        objects, furniture = books(n_books), (cupboard(), *stand())
        kind = robot_named(robot)
        self._places = places_of(SHELF_PLACES, kind, "shelve")
        kind.check_grip(BOOK_SIZE[1], "a book")
        super().__init__(
            name="shelve",
            robot=kind,
            things=SceneSpec(objects, furniture),
            goals=n_books,
            motions=2 * n_books,
            level=level,
            obstacles=obstacles,
            control_mode=control_mode,
            reward=reward,
            render_mode=render_mode,
            control_frequency=control_frequency,
            view=VIEW,
            more={"furniture_pose": pose_box(len(furniture))},
        )
        self._ready, self._rules = np.array([self._places.ready]), shelve_rules(n_books)
        self._drawn = shelf_layout(np.random.default_rng(0), RANGES["L0"], self._places, n_books, self._ready.shape)
        self._take_layout(self._drawn)

    def _take_layout(self, drawn: ShelfLayout) -> None:
        self._drawn, self._goal_pose = drawn, drawn.goals(self.shelf)
        self._furniture = drawn.furniture()
        self._handed = 1
        self._progress = GoalProgress(self._rules, self._goal_pose, drawn.objects(), self.control_dt)

    def _start(self, options: dict[str, Any], layout: str, spacious: bool) -> Start:
        check_known(options, OPTIONS)
        drawn, joints = self._drawn_clear(options, layout)
        self._take_layout(drawn)
        return Start(joints, drawn.objects(), self._furniture)

    def _drawn_clear(self, options: dict[str, Any], layout: str) -> tuple[ShelfLayout, np.ndarray]:
        """Draw a layout, and start joints at which the hand is clear of the first book."""
        lower, upper = [arm.lower for arm in self.arms], [arm.upper for arm in self.arms]
        for _ in range(MAX_LAYOUTS):
            drawn = shelf_layout(self.np_random, RANGES[layout], self._places, self.n_books, self._ready.shape)
            drawn = given_layout(drawn, options, self._places)
            if "joint_positions" in options:
                return drawn, checked_joints(options["joint_positions"], self.arms)
            joints = np.clip(self._ready + drawn.joints, lower, upper)
            if self._is_clear(drawn.handed(0), joints, START_CLEARANCE):
                return drawn, joints
        raise BadOption("stand_pose", "the robot would start at the book; give joint_positions that are away from it")

    def step(self, action: np.ndarray) -> tuple[Observation, float, bool, bool, dict[str, Any]]:
        """Apply an action for one control step; afterwards hand over the next book if it is due."""
        reached = super().step(action)
        k = self._handed
        if (
            k < self.n_books
            and self._progress.placed == k
            and self._is_clear(self._drawn.handed(k), reached[0]["joint_positions"], CLEAR)
        ):
            pose = self._drawn.handed(k).vector
            self.sim.put(k, pose)
            hand_over(self._progress, k, pose)
            self._handed += 1
        return reached

    def _is_clear(self, place: Pose, joints: np.ndarray, clearance: float) -> bool:
        """Return whether the whole robot, at joints (n_arms, dof), keeps a clearance [m] from a book's place."""
        book = pack([Obstacle(Box(BOOK_SIZE), place)])
        return all(
            arm_clearance(arm, body, q, book) >= clearance
            for arm, body, q in zip(self.arms, self._task.bodies, joints, strict=True)
        )

    def _placement_motions(self, start: Start) -> list[PlacementMotion]:
        """Return the carries: from above the stand to in front of the slot."""
        motions = []
        for k, goal in enumerate(self._goal_pose):
            grasp, release = self._drawn.handed(k) @ GRASP, Pose.from_vector(goal) @ GRASP
            up = Pose.from_position_quaternion([0.0, 0.0, LIFT])
            back = [release @ Pose.from_position_quaternion([0.0, 0.0, -part * INSERTION_DEPTH]) for part in (1.0, 0.5)]
            keys = tuple((pose,) for pose in (grasp, up @ grasp, *back, release))
            held = (Box(BOOK_SIZE), GRASP.inverse(), 2 * k + 1)
            motions.append(PlacementMotion(up @ grasp, back[0], keys, *held, aside=SPREAD, above=SPREAD, straight=3))
        return motions

    def _paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return two obstacles of different size: one appears with the last but one book, one with the last."""
        last = len(motions) - 1
        return [ObstacleRequest("appear", max(0, last - 1 + k), size) for k, size in enumerate(PAPER_SIZES)]

    def _ghosts(self) -> list[Ghost]:
        return [Ghost(pose, Box(BOOK_SIZE)) for pose in self._goal_pose[self._progress.placed :]]

    def _more_observed(self, state: State) -> Observation:
        return {"furniture_pose": self._furniture.copy()}
