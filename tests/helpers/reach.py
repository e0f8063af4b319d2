"""How much of a task a robot can reach from given places: inverse kinematics along the whole way, nothing touching.

Knows the demonstration, but neither the planner, which finds other ways too, nor the physics.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from onedemo.baselines.programs.dual_arm_executor import WRIST
from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.envs import ROBOTS
from onedemo.envs.core.description import TaskFurniture
from onedemo.envs.pour import layout as pour_layouts
from onedemo.envs.pour.facts import TARGET
from onedemo.envs.pour.geometry import BACK, GLASSES, STANDS, TILTED, UP, grasp, pouring
from onedemo.envs.pour.places import PourPlaces
from onedemo.envs.scene.robot_description import robot_parts
from onedemo.envs.scene.scene import compiled_scene
from onedemo.envs.shelve import layout as shelf_layouts
from onedemo.envs.shelve.layout import ShelfLayout, shelf_layout
from onedemo.envs.shelve.parts import BOOK_SIZE, cupboard, stand, waiting
from onedemo.envs.shelve.places import ShelfPlaces
from onedemo.planner.collision.clearance import slack_at
from onedemo.planner.collision.robot_arrays import robot_arrays
from onedemo.planner.collision.self_collision import pairs_of
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, pack
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import resampled
from onedemo.planner.imitation.tsia import final_path, guide_index, imitated_path
from onedemo.planner.robot.body import Body
from onedemo.planner.safety.robot_checks import contact_masks
from onedemo.planner.safety.safety_layer import SafetySettings

MARGIN = 0.08
"""Distance to the joints' limits [rad] that is kept everywhere."""
JUMP = 0.8
"""Change of a joint [rad] from one pose to the next that is no following any more."""
STEP = 0.03
"""Screw length [m] between the poses that are solved."""
TOUCH = -0.003
"""Room [m] below which something touches: capsules contain more than the links."""
TURNS = np.deg2rad([75 + turn for turn in (0, 15, -15, 30, -30, 45, -45, 60, -60, 75, -75)])
"""Directions [rad] of a hand at a round glass, the demonstrated one first."""
BEFORE = 0.13
"""Way [m] of the hand straight to the source."""
LIFT = 0.12
FURNITURE = [TaskFurniture.of(each) for each in (cupboard(), *stand())]
RELEASE = 0.005
"""Height [m] above its slot at which a book is let go."""


def up(height: float) -> Pose:
    """A way straight up, in the world."""
    return Pose.from_position_quaternion([0.0, 0.0, height])


class Reach:
    """A robot at the table, with what stands there for ever."""

    def __init__(self, robot: str):
        scene = compiled_scene(ROBOTS[robot])
        self.arm, self.home = scene.arms[0].arm, scene.home[0]
        self._parts = robot_parts(scene)
        self.body = self._parts.bodies[0]
        self._pairs = pairs_of((self.arm,), self._parts.bodies, apart=WRIST)

    def among(
        self, obstacles: Iterable[Obstacle], allowed: Sequence[tuple[str, str]] = (), body: Body | None = None
    ) -> np.ndarray:
        """The robot, or a body of it that holds something, among these and its fixtures, for `slack`.

        The contacts of `allowed` do not count.
        """
        solids, body = (*self._parts.fixtures, *obstacles), body or self.body
        masks = contact_masks(body.names, solids, (*self._parts.touching, *allowed))
        settings = SafetySettings().packed(0.02)
        return robot_arrays((self.arm,), (body,), pack(solids), masks=masks, pairs=self._pairs, settings=settings)

    def slack(self, work: np.ndarray, q: np.ndarray) -> float:
        """Smallest room [m] of the arm, also to itself."""
        return float(slack_at(work, q, 0.0, 1.0))

    def solved(self, pose: Pose, q: np.ndarray) -> np.ndarray | None:
        """Joints near q (dof,) at a pose, within the limits."""
        found = inverse_kinematics(self.arm, pose, np.clip(q, self.arm.lower, self.arm.upper))
        return found if found is not None and self.arm.margin(found) >= MARGIN else None

    def along(self, path: PosePath, q: np.ndarray | None, work: np.ndarray) -> np.ndarray | None:
        """Joints at the end of a path that is followed from q; None where it cannot be, or something touches."""
        for row in path.dqs:
            found = None if q is None else self.solved(Pose(row), q)
            if found is None or np.abs(found - q).max() > JUMP or self.slack(work, found) < TOUCH:
                return None
            q = found
        return q

    def to(self, poses: Sequence[Pose], q: np.ndarray | None, work: np.ndarray) -> np.ndarray | None:
        """The same along screws from where the hand is to one pose after the other."""
        for pose in poses:
            if q is None:
                return None
            q = self.along(line(self.arm.fk(q), pose), q, work)
        return q

    def near(self, ready: np.ndarray, way: float, rng: np.random.Generator) -> np.ndarray:
        """Start joints as a level draws them."""
        return np.clip(ready + rng.uniform(-way, way, self.arm.dof), self.arm.lower, self.arm.upper)


def line(start: Pose, end: Pose) -> PosePath:
    """The screw from start to end, without the start."""
    distance, angle = start.distance_to(end)
    count = max(1, int(np.ceil((distance + 0.15 * angle) / STEP)))
    return PosePath(dq.sclerp(start.dq, end.dq, np.linspace(0.0, 1.0, count + 1)[1:]))


class PourReach(Reach):
    """A robot that is to pour."""

    def __init__(self, robot: str):
        super().__init__(robot)
        self._stands = [TaskFurniture.of(each) for each in STANDS]

    def share(self, places: PourPlaces, level: str, count: int, seed: int = 0) -> tuple[float, float]:
        """Of `count` starts the share that can be poured, and can be in the demonstrated directions."""
        ranges, rng, done = pour_layouts.RANGES[level], np.random.default_rng(seed), []
        nominal, axis = np.array(places.stands), self.arm.chain[0, 4:6]
        for _ in range(count):
            tops = pour_layouts.pour_layout(rng, ranges, nominal, axis, pour_layouts.GAP)
            done.append(self.poured(places, tops, self.near(np.array(places.ready), ranges.joints, rng)))
        return float(np.mean([each is not None for each in done])), float(np.mean([each == (0, 0) for each in done]))

    def poured(self, places: PourPlaces, tops: np.ndarray, q: np.ndarray) -> tuple[int, int] | None:
        """Which turn of the source and of the target can be done from q, the first that can."""
        work = self.among(self.glass_and_stands(tops))
        for i, yaw in enumerate(TURNS):
            fetched = self.fetched(places, tops, yaw, q, work)
            for k, other in enumerate(TURNS if fetched is not None else ()):
                if self.emptied(places, tops, other, fetched, work) is not None:
                    return i, k
        return None

    def fetched(self, places: PourPlaces, tops: np.ndarray, yaw: float, q: np.ndarray, work: np.ndarray):
        """Joints after the source was fetched from a direction and lifted; None if it cannot be."""
        hand = grasp(places.source, tops[0] + [0.0, 0.0, 0.5 * places.source.height], yaw)
        return self.to([hand @ up(-BEFORE), hand, up(LIFT) @ hand], q, work)

    def emptied(self, places: PourPlaces, tops: np.ndarray, yaw: float, q: np.ndarray, work: np.ndarray):
        """Joints at the end of pouring in a direction; None if it cannot be."""
        rim, half = tops[TARGET] + [0.0, 0.0, GLASSES[TARGET].height], np.deg2rad(65.0)
        before = pouring(places.source, rim, yaw, 0.0, BACK, UP)
        tilted = [pouring(places.source, rim, yaw, tilt) for tilt in (half, TILTED)]
        return self.to([before, *tilted], q, work)

    def glass_and_stands(self, tops: np.ndarray) -> list[Obstacle]:
        """What stands there but for the source."""
        at = [Pose.from_position_quaternion(top) for top in tops]
        solids = [part for each, pose in zip(self._stands, at, strict=True) for part in each.at(pose)]
        target = GLASSES[TARGET]
        return [*solids, Obstacle(target.shape, at[TARGET] @ up(0.5 * target.height), name="target")]


class ShelfReach(Reach):
    """A robot that is to shelve."""

    def __init__(self, robot: str):
        super().__init__(robot)
        shown = read_demonstration(shipped_demonstration("shelve"))
        names = ("reach", "lift", "carry", "insert", "retreat")
        self.parts = {name: resampled(shown.segment_path(name), STEP) for name in names}
        self.grasp = shown.segment("reach").reference_pose.inverse() @ self.parts["reach"][-1]

    def share(self, places: ShelfPlaces, level: str, count: int, shelf: str = "upper", seed: int = 0) -> float:
        """Of `count` starts the share in which all three books can be shelved."""
        ranges, rng, done = shelf_layouts.RANGES[level], np.random.default_rng(seed), 0
        for _ in range(count):
            drawn = shelf_layout(rng, ranges, places, 3, (1, self.arm.dof))
            done += self.shelved(drawn, self.near(np.array(places.ready) + drawn.joints[0], 0.0, rng), shelf)
        return done / count

    def shelved(self, drawn: ShelfLayout, q: np.ndarray | None, shelf: str) -> bool:
        """Whether all books can be shelved from joints q."""
        work, loaded = self.works(drawn)
        for k, goal in enumerate(drawn.goals(shelf)):
            q = self._book(drawn.handed(k), Pose.from_vector(goal), q, work, loaded)
        return q is not None

    def works(self, drawn: ShelfLayout) -> tuple[np.ndarray, np.ndarray]:
        """The arm among the furniture with an empty hand, and with a book in it."""
        around = self.furniture(drawn)
        full = self.body.holding("held", Box(BOOK_SIZE), self.grasp.inverse(), self.arm)
        wanted = ("fingers", "stand")
        return self.among(around, (wanted,)), self.among(around, (wanted, ("held", "stand")), full)

    def furniture(self, drawn: ShelfLayout) -> list[Obstacle]:
        """What stands there: the pile of books that wait, too."""
        poses = [Pose.from_vector(row) for row in drawn.furniture()]
        solids = [part for each, pose in zip(FURNITURE, poses, strict=True) for part in each.at(pose)]
        return [*solids, *(Obstacle(Box(BOOK_SIZE), waiting(drawn.pile, k), name="pile") for k in range(2))]

    def before(self, goal: Pose) -> Pose:
        """The hand before a slot."""
        return self.insertion(goal)[0]

    def insertion(self, goal: Pose) -> PosePath:
        """The hand's way into a slot."""
        return imitated_path(self.parts["insert"], up(RELEASE) @ goal @ self.grasp)

    def carried(self, lifted: Pose, before: Pose) -> PosePath:
        """The way from above the stand to before a slot, as imitated."""
        carry = imitated_path(self.parts["carry"], before)
        return final_path(lifted, carry, guide_index(carry))

    def _book(
        self, book: Pose, goal: Pose, q: np.ndarray | None, work: np.ndarray, loaded: np.ndarray
    ) -> np.ndarray | None:
        """Joints after a book was fetched and shelved."""
        reach, insert = imitated_path(self.parts["reach"], book @ self.grasp), self.insertion(goal)
        lift, retreat = (
            self.parts[name].moved(start @ self.parts[name][0].inverse())
            for name, start in (("lift", reach[-1]), ("retreat", insert[-1]))
        )
        q = self.to([reach[0]], q, work)
        carry = self.carried(lift[-1], insert[0])
        for path, around in ((reach, work), (lift, work), (carry, loaded), (insert, work), (retreat, work)):
            q = self.along(path, q, around)
        return q
