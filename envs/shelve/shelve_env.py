"""Shelving books in a cluttered cupboard."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from ...planner import Box, Obstacle, Pose
from ...planner.errors import BadOption
from ...planner.geometry.shapes import pack
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.environment import MAX_LAYOUTS
from ..core.maker import EnvironmentMaker
from ..core.placement_context import ObstacleRequest, PlacementMotion
from ..core.reset_options import check_known, checked_choice, checked_joints
from ..core.spaces import pose_box
from ..judge.goal_progress import GoalProgress
from ..scene.body_clearance import arm_clearance
from ..scene.robots import places_of, robot_named
from ..scene.scene_objects import SceneSpec
from ..simulation.render import Ghost, View
from ..simulation.simulation import Start
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


@dataclass
class Handing:
    """Books handed over, and where.

    Attributes:
        layout: the layout of the episode.
        handed: number of books handed over.
    """

    layout: ShelfLayout
    handed: int = 1


class Shelving(DeclaredTask):
    """Shelving books.

    Args:
        robot: name of the robot.
        n_books: number of books.
        shelf: "upper" or "lower".
    """

    facts, name, view = SHELVE, SHELVE.name, VIEW

    def __init__(self, robot: str = "Panda", n_books: int = 3, shelf: str = "upper"):
        if isinstance(n_books, bool) or not isinstance(n_books, int) or not 1 <= n_books <= MOST_BOOKS:
            raise BadOption("n_books", f"{n_books!r} is not a whole number from 1 to {MOST_BOOKS}")
        self.n_books, self.shelf = n_books, checked_choice("shelf", shelf, tuple(SHELVES))
        furniture = (cupboard(), *stand())
        self.things, self.robot = SceneSpec(books(n_books), furniture), robot_named(robot)
        self.places = places_of(SHELF_PLACES, self.robot, "shelve")
        self.robot.check_grip(BOOK_SIZE[1], "a book")
        self.goals, self.motions, self.rules = n_books, 2 * n_books, shelve_rules(n_books)
        self.more: Mapping[str, Any] = {"furniture_pose": pose_box(len(furniture))}
        self.ready = np.array([self.places.ready])

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`."""
        check_known(options, OPTIONS)
        drawn, joints = self._drawn_clear(world, options, layout)
        goals, objects, furniture = drawn.goals(self.shelf), drawn.objects(), drawn.furniture()
        progress = GoalProgress(self.rules, goals, objects, world.dt)
        start = Start(joints, objects, furniture)
        return TaskEpisode(start, goals, progress, {"furniture_pose": furniture}, Handing(drawn))

    def _drawn_clear(self, world: World, options: dict[str, Any], layout: str) -> tuple[ShelfLayout, np.ndarray]:
        """Draw a layout, and start joints at which the hand is clear of the first book."""
        lower, upper = [arm.lower for arm in world.arms], [arm.upper for arm in world.arms]
        for _ in range(MAX_LAYOUTS):
            drawn = shelf_layout(world.rng, RANGES[layout], self.places, self.n_books, self.ready.shape)
            drawn = given_layout(drawn, options, self.places)
            if "joint_positions" in options:
                return drawn, checked_joints(options["joint_positions"], world.arms)
            joints = np.clip(self.ready + drawn.joints, lower, upper)
            if _is_clear(world, drawn.handed(0), joints, START_CLEARANCE):
                return drawn, joints
        raise BadOption("stand_pose", "the robot would start at the book; give joint_positions that are away from it")

    def follow(self, world: World, episode: TaskEpisode, observation: dict[str, np.ndarray]) -> None:
        """See `DeclaredTask`: hand over the next book if it is due."""
        handing, progress = episode.layout, episode.progress
        assert isinstance(handing, Handing) and isinstance(progress, GoalProgress)
        k = handing.handed
        if k < self.n_books and progress.placed == k:
            place = handing.layout.handed(k)
            if _is_clear(world, place, observation["joint_positions"], CLEAR):
                world.sim.put(k, place.vector)
                hand_over(progress, k, place.vector)
                handing.handed += 1

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`: the carries: from above the stand to in front of the slot."""
        motions = []
        for k, goal in enumerate(episode.goals):
            grasp, release = episode.layout.layout.handed(k) @ GRASP, Pose.from_vector(goal) @ GRASP
            up = Pose.from_position_quaternion([0.0, 0.0, LIFT])
            back = [release @ Pose.from_position_quaternion([0.0, 0.0, -part * INSERTION_DEPTH]) for part in (1.0, 0.5)]
            keys = tuple((pose,) for pose in (grasp, up @ grasp, *back, release))
            held = (Box(BOOK_SIZE), GRASP.inverse(), 2 * k + 1)
            motions.append(PlacementMotion(up @ grasp, back[0], keys, *held, aside=SPREAD, above=SPREAD, straight=3))
        return motions

    def paper(self, motions: list[PlacementMotion]) -> list[ObstacleRequest]:
        """Return two obstacles of different size: one appears with the last but one book, one with the last."""
        last = len(motions) - 1
        return [ObstacleRequest("appear", max(0, last - 1 + k), size) for k, size in enumerate(PAPER_SIZES)]

    def ghosts(self, episode: TaskEpisode) -> list[Ghost]:
        """See `DeclaredTask`."""
        assert isinstance(episode.progress, GoalProgress)
        return [Ghost(pose, Box(BOOK_SIZE)) for pose in episode.goals[episode.progress.placed :]]


def _is_clear(world: World, place: Pose, joints: np.ndarray, clearance: float) -> bool:
    """Return whether the whole robot, at joints (n_arms, dof), keeps a clearance [m] from a book's place."""
    book = pack([Obstacle(Box(BOOK_SIZE), place)])
    return all(
        arm_clearance(arm, body, q, book) >= clearance
        for arm, body, q in zip(world.arms, world.task.bodies, joints, strict=True)
    )


shelve_env = EnvironmentMaker(Shelving)
