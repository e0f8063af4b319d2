"""Random problems, each a pure function of its kind and seed: a Panda among obstacles, and tools without an arm.

What is accepted does not depend on whether a planner solves it. A draw is thrown away only if the start is not clear,
the tool at the goal is not, no posture that reaches the goal is, something stands in the arm's base, or start and goal
are too near to each other. These are facts about single postures, told by the same distances that the tests of
`proximity` check. Whether a way
exists between them is nobody's business here: `feasible` asks that of what was not solved. A cage stands round the
goal, so of a cage only the start is asked to be clear.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from typing import NamedTuple

import fcl
import numpy as np
from helpers.arms import table_panda
from helpers.solids import KINDS as SHAPES
from helpers.solids import fcl_distance, fcl_obstacle, random_shape
from helpers.strategies import random_dq

from onedemo.configs.shipped_files import shipped_demonstration
from onedemo.planner.control.inverse_kinematics import inverse_kinematics
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Obstacle, Shape, Sphere
from onedemo.planner.imitation.demonstration_files import read_demonstration
from onedemo.planner.imitation.segmentation import resampled, trimmed
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.judge.certify import Certificate, certify
from onedemo.planner.log.motion_log import MotionLog
from onedemo.planner.planning.plan import Plan
from onedemo.planner.planning.planner import Planner
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.planning.settings import PlanSettings
from onedemo.planner.resumable import finished
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import BODY, Body
from onedemo.planner.robot.chain_readers import turn_z_to
from onedemo.planner.search.joint_paths import JointPaths

KINDS = ("convex", "clutter", "gap", "trap", "shelf", "held", "cage")
SOLVABLE = KINDS[:-1]
SETTINGS = PlanSettings()
START_ROOM, GOAL_ROOM, POSTURE_ROOM = 0.005, 0.005, 0.003
"""What start, tool at the goal and goal posture must have beyond the safety distance [m]."""
NEAREST = 0.2
"""Start and goal are farther apart than this [m]."""


class Problem(NamedTuple):
    """A motion to plan.

    Attributes:
        kind: see `KINDS`.
        seed: that it was drawn from.
        body: of the arm, held object included.
        start: (7,) joints.
        goal: of the tcp.
        obstacles: in the way.
        posture: (7,) clear joints that reach the goal; None in a cage.
    """

    kind: str
    seed: int
    body: Body
    start: np.ndarray
    goal: Pose
    obstacles: tuple[Obstacle, ...]
    posture: np.ndarray | None


def panda() -> tuple[Arm, Body, np.ndarray]:
    """The Panda as it stands at the table: arm, capsules, usual joints."""
    return table_panda()


@cache
def demonstrated() -> PosePath:
    """The shipped transfer of a cube, in steps of 5 mm."""
    demo = read_demonstration(shipped_demonstration("stack"))
    return resampled(trimmed(demo.segment_path("transfer"), 0.02), 0.005)


def at(position, quaternion=(1.0, 0.0, 0.0, 0.0)) -> Pose:
    return Pose.from_position_quaternion(np.asarray(position, dtype=float), quaternion)


def anyhow(rng: np.random.Generator, position) -> Pose:
    """A pose at a position, turned by chance."""
    return at(position, Pose(random_dq(rng)).quaternion)


def any_shape(rng: np.random.Generator, size: float) -> Shape:
    return random_shape(rng, SHAPES[rng.integers(len(SHAPES))], size)


def boxes(world_from_group: Pose, *parts) -> list[Obstacle]:
    """Boxes of (size, position) in the frame of their group."""
    return [Obstacle(Box(tuple(size)), world_from_group @ at(place)) for size, place in parts]


def wall(pose: Pose, gap: tuple[float, float], size: float, thick: float = 0.03) -> list[Obstacle]:
    """Four boards across x that leave a gap of (width, height) in a square wall."""
    (w, h), out = gap, []
    for side in (-1.0, 1.0):
        out.append(((thick, (size - w) / 2, size), (0.0, side * (size + w) / 4, 0.0)))
        out.append(((thick, w, (size - h) / 2), (0.0, 0.0, side * (size + h) / 4)))
    return boxes(pose, *out)


def trap(pose: Pose, width: float) -> list[Obstacle]:
    """A U that opens towards -x."""
    sides = [((0.12, 0.02, 0.25), (-0.06, side * width / 2, 0.0)) for side in (-1, 1)]
    return boxes(pose, ((0.02, width, 0.25), (0.0, 0.0, 0.0)), *sides)


def shelf(pose: Pose, width: float, depth: float) -> list[Obstacle]:
    """A corner of two sides and a bottom."""
    return boxes(
        pose,
        ((0.3, 0.3, 0.02), (0.0, 0.0, -depth)),
        ((0.02, 0.3, 0.3), (width, 0.0, 0.05)),
        ((0.3, 0.02, 0.3), (0.0, width, 0.05)),
    )


def cage(pose: Pose, half: float, thick: float = 0.02) -> list[Obstacle]:
    """Six boards that leave no way out."""
    out = []
    for axis in range(3):
        size, place = np.full(3, 2 * half + thick), np.zeros(3)
        size[axis], place[axis] = thick, half
        out += [(size, place), (size, -place)]
    return boxes(pose, *out)


def _obstacles(kind: str, rng: np.random.Generator, start: np.ndarray, goal: np.ndarray) -> list[Obstacle]:
    """What stands about the middle between two positions, or round the second."""
    middle = start + (goal - start) * rng.uniform(0.3, 0.7) + rng.normal(size=3) * 0.03
    across = Pose.from_yaw(middle, np.arctan2(*(goal - start)[1::-1]))
    if kind in ("convex", "held"):
        return [Obstacle(any_shape(rng, 0.25), anyhow(rng, middle))]
    if kind == "clutter":
        places = middle + rng.normal(size=(8, 3)) * [0.25, 0.25, 0.2]
        return [Obstacle(any_shape(rng, 0.2), anyhow(rng, place)) for place in places]
    if kind == "gap":
        return wall(at(rng.normal(size=3) * 0.05) @ across, tuple(rng.uniform(0.3, 0.45, 2)), 0.9)
    if kind == "trap":
        return trap(across, rng.uniform(0.15, 0.3))
    if kind == "shelf":
        return shelf(Pose.from_yaw(goal, rng.uniform(-np.pi, np.pi)), rng.uniform(0.12, 0.2), rng.uniform(0.06, 0.11))
    return cage(at(goal), 0.22)


def problem(kind: str, seed: int) -> Problem:
    """The problem of a kind and a seed."""
    arm, empty, home = panda()
    rng = np.random.default_rng([KINDS.index(kind), seed])
    while True:
        start = np.clip(home + rng.normal(size=7) * 0.25, arm.lower + 0.1, arm.upper - 0.1)
        turn = Pose.from_yaw([0, 0, 0], rng.uniform(-0.8, 0.8)) @ at([0, 0, 0], demonstrated()[-1].quaternion)
        goal = at(rng.uniform([-0.2, -0.35, 0.85], [0.15, 0.35, 1.15]), turn.quaternion)
        here = arm.fk(start).position
        if np.linalg.norm(goal.position - here) < NEAREST:
            continue
        body = empty
        if kind == "held":
            body = empty.holding("box", Box(tuple(rng.uniform(0.04, 0.12, 3))), at([0, 0, 0.03]), arm)
        obstacles = tuple(_obstacles(kind, rng, here, goal.position))
        scene = PlanningScene.of(arm, body, obstacles, SETTINGS)
        if scene.slack(start) < START_ROOM or base_gap(body, obstacles) < SETTINGS.safety.distance:
            continue
        if kind == "cage":
            return Problem(kind, seed, body, start, goal, obstacles, None)
        if scene.tool_slack(goal) < GOAL_ROOM:
            continue
        posture = clear_posture(arm, scene, goal, start, rng)
        if posture is not None:
            return Problem(kind, seed, body, start, goal, obstacles, posture)


def base_gap(body: Body, obstacles) -> float:
    """Distance [m] of the parts that no joint moves; `PlanningScene.slack` leaves them out."""
    return tool_gap(body.rows[body.rows[:, BODY.frame] < 0][:, BODY.a :], obstacles, Pose.identity())


def clear_posture(arm, scene, goal, start, rng, tries: int = 12) -> np.ndarray | None:
    """Joints that reach a goal clear, the first guess being the start."""
    for k in range(tries):
        guess = start if k == 0 else rng.uniform(arm.lower, arm.upper)
        q = inverse_kinematics(arm, goal, guess)
        if q is not None and scene.slack(q) > POSTURE_ROOM:
            return q
    return None


@cache
def planner_of(settings: PlanSettings = SETTINGS) -> Planner:
    return Planner(*panda()[:2], settings)


def solve(problem: Problem, settings: PlanSettings = SETTINGS, **options) -> Plan:
    """The plan of a problem, the demonstration being the shipped transfer."""
    arm, empty, _ = panda()
    planner = planner_of(settings) if problem.body is empty else Planner(arm, problem.body, settings)
    options = {"seed": problem.seed, **options}
    return planner.plan(demonstrated(), problem.start, problem.goal, problem.obstacles, **options)


def log_of(plan: Plan, arm: Arm, body: Body, goal: Pose, obstacles, settings: PlanSettings = SETTINGS, allowed=()):
    """A plan as its judge takes it: what was asked, the joints, and no word of the planner's but the joint margin."""
    return MotionLog(
        arm=arm,
        body=body,
        obstacles=tuple(obstacles),
        time=plan.dt * np.arange(len(plan.joints)),
        joints=plan.joints,
        safety=settings.safety.distance,
        goal=goal,
        demonstrated=plan.path,
        allowed=tuple(allowed),
        claims={"joint_margin": plan.margin},
    )


def judged(problem: Problem, plan: Plan) -> Certificate:
    """What the independent judge says of a plan that is called a success."""
    log = log_of(plan, panda()[0], problem.body, problem.goal, problem.obstacles)
    certificate = certify(log)
    if np.array_equal(plan.joints[0], problem.start):
        return certificate
    raise AssertionError("the plan does not start where the arm stands")


def feasible(problem: Problem, postures: int = 20, iterations: int = 40_000) -> bool:
    """A search with a hundred times the effort finds a way in joint space to some clear posture at the goal.

    It need not keep anything of the demonstration. True is proven; False only means that no way was found.
    """
    if problem.posture is None:
        return False
    arm, rng = panda()[0], np.random.default_rng(problem.seed)
    scene = PlanningScene.of(arm, problem.body, problem.obstacles, SETTINGS)
    paths = JointPaths(arm.dof, 20_000, 0)
    for k in range(postures):
        goal = problem.posture
        if k > 0:
            goal = clear_posture(arm, scene, problem.goal, rng.uniform(arm.lower, arm.upper), rng, 1)
        if goal is None:
            continue
        if finished(paths.connected(scene.robot, problem.start, goal, 0.3, iterations, 0)) is not None:
            return True
    return False


class ToolProblem(NamedTuple):
    """A path of a tool without an arm.

    Attributes:
        path: of the tcp.
        tool: (m, 7) capsules in the tcp's frame.
        obstacles: in the way.
    """

    path: PosePath
    tool: np.ndarray
    obstacles: tuple[Obstacle, ...]


def random_tool(rng: np.random.Generator, parts: int = 3) -> np.ndarray:
    """(parts, 7) capsules of up to 8 cm near the tcp."""
    ends = rng.uniform(-0.04, 0.04, (parts, 2, 3))
    return np.column_stack([ends.reshape(parts, 6), rng.uniform(0.01, 0.03, parts)])


def tool_problem(
    kind: str, seed: int, shape: Callable[[np.random.Generator], Shape] | str | None = None
) -> ToolProblem:
    """A tool on a screw of half a meter, with one of the obstacles of `KINDS` on its way (not "held").

    Args:
        kind: of the obstacles.
        seed: of all that is random.
        shape: the kind of a single convex obstacle, see `solids.KINDS`; None: any.
    """
    rng = np.random.default_rng([100 + KINDS.index(kind), seed])
    while True:
        tool = random_tool(rng)
        start, way = anyhow(rng, rng.uniform(-0.3, 0.3, 3)), rng.normal(size=3)
        way *= rng.uniform(0.5, 0.8) / np.linalg.norm(way)
        turn = random_dq(rng)
        goal = at(start.position + way, Pose(turn).quaternion if rng.uniform() < 0.5 else start.quaternion)
        path = screw_path(start, goal, 0.01)
        if kind == "convex":
            made = random_shape(rng, shape or SHAPES[rng.integers(len(SHAPES))], 0.3)
            place = path[len(path) // 2].position + rng.normal(size=3) * 0.01
            obstacles = [Obstacle(made, anyhow(rng, place))]
        else:
            obstacles = _obstacles(kind, rng, start.position, goal.position)
        ends = [start] if kind == "cage" else [start, goal]
        if all(tool_gap(tool, obstacles, end) > 0.06 for end in ends):
            return ToolProblem(path, tool, tuple(obstacles))


class Gauge:
    """Distance [m] of a tool at a pose from obstacles, by fcl; a negative number, of no meaning, if they touch.

    Args:
        tool: (m, 7) capsules in the tcp's frame.
        obstacles: in the world.
    """

    def __init__(self, tool: np.ndarray, obstacles):
        lengths = np.linalg.norm(tool[:, 3:6] - tool[:, :3], axis=1)
        self._parts = [fcl.CollisionObject(fcl.Capsule(row[6], z)) for row, z in zip(tool, lengths, strict=True)]
        self._places = [at(0.5 * (row[:3] + row[3:6]), along(row[3:6] - row[:3])) for row in tool]
        self._solids = [fcl_obstacle(obstacle) for obstacle in obstacles]

    def __call__(self, pose: Pose) -> float:
        least = np.inf
        for part, place in zip(self._parts, self._places, strict=True):
            placed = pose @ place
            part.setTransform(fcl.Transform(placed.rotation, placed.position))
            least = min([least, *(fcl_distance(part, solid) for solid in self._solids)])
        return least


def along(way: np.ndarray) -> np.ndarray:
    """(4,) quaternion that turns z to a direction; any for no way at all."""
    length = np.linalg.norm(way)
    return turn_z_to(way) if length > 0 else np.array([1.0, 0.0, 0.0, 0.0])


def tool_gap(tool: np.ndarray, obstacles, pose: Pose) -> float:
    """`Gauge` for a single pose."""
    return Gauge(tool, obstacles)(pose)


def ball_at(position, radius: float = 0.05) -> Obstacle:
    return Obstacle(Sphere(radius), at(position), name="ball")


def everywhere(ball: Obstacle) -> tuple[tuple[str, str], ...]:
    """Contacts of all moving parts of the Panda with a ball."""
    return tuple((part, ball.name) for part in dict.fromkeys(panda()[1].names) if part != "link0")


def blocked() -> tuple[np.ndarray, np.ndarray, Obstacle]:
    """Joints on both sides of a ball that the hand would sweep through."""
    arm, _, home = panda()
    turn = np.array([1.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0])
    return home, home + turn, ball_at(arm.fk(home + 0.5 * turn).position)
