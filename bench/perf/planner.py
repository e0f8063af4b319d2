"""Measurements of the planner: distance queries, trees, control steps, plans, and the growth of their cost."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from importlib import import_module
from itertools import cycle
from typing import Any

import numpy as np

from ...envs.scene.robots import ROBOTS
from ...planner.collision import clearance, proximity
from ...planner.collision.capsule_placement import place_capsules
from ...planner.collision.edge_certificates import tool_arrays
from ...planner.collision.robot_arrays import ROW, robot_arrays
from ...planner.control.arm_arrays import arm_arrays
from ...planner.escape.repet import RepetSettings, escape_path, point_tool
from ...planner.escape.tree_arrays import NODE, OPTION
from ...planner.geometry.pose import Pose, PosePath
from ...planner.geometry.shapes import Box, Capsule, Obstacle, Shape, Sphere, pack
from ...planner.jit import kernel
from ...planner.planning.batch import plan_batch
from ...planner.planning.plan import PlanRequest
from ...planner.planning.planner import Planner
from ...planner.planning.settings import PlanSettings
from ...planner.robot.arm import Arm
from ...planner.robot.body import BODY
from ...planner.safety.guarded_pursuit import safe_tick
from ...planner.safety.safety_layer import SafetySettings
from ..plan.tree_times import expand_loop
from .measuring import Row, row, seconds_per_call
from .ompl_peer import ompl_solver
from .peers import READY, dq_robotics_tick, panda_urdf, pinocchio_kinematics

SWAY = 100
"""Control steps per sway of the measured arm, by 0.1 rad at every joint."""
DOWN = np.array([0.0, 0.5, 0.5, 0.0]) * np.sqrt(2.0)
"""Unit quaternion of a tool that points down, as at the Panda's usual joints."""
FAR = 1.5
"""Largest distance [m] of obstacles that are known but not near."""


@cache
def _panda() -> tuple[Any, Any, np.ndarray]:
    """Return arm, body and usual joints (7,) [rad] of the Panda."""
    from ...envs.scene.robot_bodies import robot_body
    from ...envs.scene.scene import compiled_scene

    scene = compiled_scene(ROBOTS["Panda"])
    return scene.arms[0].arm, robot_body(ROBOTS["Panda"]), np.array(scene.home[0])


def _spread(count: int, shapes: list[Shape], seed: int = 0) -> list[Obstacle]:
    """Return obstacles all around the arm, none of them within the safety layer's shell."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(count):
        direction = rng.normal(size=3)
        place = np.array([-0.2, 0.0, 1.1]) + direction / np.linalg.norm(direction) * rng.uniform(0.9, FAR)
        found.append(Obstacle(shapes[k % len(shapes)], Pose.from_position_quaternion(place), name=f"o{k}"))
    return found


MIXED: list[Shape] = [Sphere(0.05), Box((0.1, 0.1, 0.1)), Capsule(0.04, 0.1)]


@kernel
def _query_loop(rows, vertices, segments, repeats):
    total = 0.0
    for i in range(repeats):
        for k in range(len(rows)):
            j = (i + k) & 63
            a = (segments[j, 0], segments[j, 1], segments[j, 2])
            b = (segments[j, 3], segments[j, 4], segments[j, 5])
            total += proximity.distance(rows, k, vertices, a, b)
    return total


def _query(name: str, shape: Shape) -> Row:
    """Measure the distance between a capsule's core and a shape, in a compiled loop."""
    rng = np.random.default_rng(0)
    segments = rng.uniform(-0.5, 0.5, (64, 6))
    segments[:, 3:] = segments[:, :3] + rng.uniform(-0.1, 0.1, (64, 3))
    packed = pack([Obstacle(shape, Pose.from_yaw(rng.uniform(-1, 1, 3), 0.3)) for _ in range(20)])
    ours, pin = seconds_per_call(
        lambda: _query_loop(packed.rows, packed.vertices, segments, 100), pinocchio_kinematics(READY)
    )
    value = ours / 2000
    note = f"{value * 1e9:.1f} ns where Pinocchio's FK + Jacobian takes {pin * 1e6:.2f} us"
    return row(name, value / pin, "ratio", 0.0075, note)


def _level(name: str, shape: Shape, goal: float) -> Row:
    """Measure a level of an escape tree: a plane and eight children with proven edges, in a compiled loop."""
    rng = np.random.default_rng(1)
    directions = rng.normal(size=(5, 3))
    places = 0.25 * directions / np.linalg.norm(directions, axis=1)[:, None]
    obstacles = [Obstacle(shape, Pose.from_yaw(place, 0.3)) for place in places]
    g, options = tool_arrays(point_tool(0.02), pack(obstacles), margin=0.02), RepetSettings().packed()
    options[OPTION.largest_margin], options[OPTION.random] = 0.02, 0.0  # the first tree has no random children
    tree, cells, state = np.zeros((16, NODE.width)), np.full(64, -1.0), np.ones(1)
    tree[0, 0], towards = 1.0, np.array([[1.0, 0.0, 0.0, 0.0, 0.0, 0.4, 0.0, 0.0]])
    ours, pin = seconds_per_call(
        lambda: expand_loop(g, tree, towards, cells, options, state, 100), pinocchio_kinematics(READY)
    )
    value = ours / 100
    note = f"{value * 1e6:.2f} us for 8 children and 5 obstacles where Pinocchio takes {pin * 1e6:.2f} us"
    return row(name, value / pin, "ratio", goal, note)


def _tick(count: int) -> Callable[[], object]:
    """Return a control step from Python of a swaying arm, kept clear of `count` obstacles as a whole."""
    arm, body, q = _panda()
    work = arm_arrays(arm, PlanSettings().motion.controller.packed())
    target, out, settings = np.array(arm.fk(q + 0.05).dq), np.empty(arm.dof), SafetySettings()
    packed = pack(_spread(count, MIXED))
    g = robot_arrays((arm,), (body,), packed, margin=settings.distance, settings=settings.packed(0.02))
    sway = cycle([q + 0.1 * np.sin(2.0 * np.pi * k / SWAY) for k in range(SWAY)])
    return lambda: safe_tick(work, g, next(sway), target, 1.0, 0.02, out)


def _tick_row(name: str, count: int) -> Row:
    goal = 1 / 12
    peer = dq_robotics_tick(READY, np.array(Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8").fk(READY + 0.1).dq))
    if peer is None:
        return Row(name, None, "ratio", goal, None, "needs: pip install 'onedemo[peers]'")
    mine, theirs = seconds_per_call(_tick(count), peer)
    note = f"{mine * 1e6:.2f} us with the whole arm guarded, against {theirs * 1e6:.1f} us without"
    return row(name, mine / theirs, "ratio", goal, note)


def _tick_growth(name: str) -> Row:
    none, twenty = seconds_per_call(_tick(0), _tick(20))
    return row(name, twenty / none, "ratio", 2.0, f"{twenty * 1e6:.2f} us against {none * 1e6:.2f} us")


def _tick_slope(name: str) -> Row:
    counts = np.array([1, 10, 50, 100])
    return _slope(name, counts, seconds_per_call(*(_tick(int(n)) for n in counts)))


def _slope(name: str, sizes: np.ndarray, seconds: list[float]) -> Row:
    """Compare the cost's growth between the last two sizes with linear growth."""
    growth = (seconds[-1] / seconds[-2]) / (sizes[-1] / sizes[-2])
    note = ", ".join(f"{n}: {s * 1e6:.3g} us" for n, s in zip(sizes, seconds, strict=True))
    return row(name, float(growth), "ratio", 1.3, f"1 is linear; {note}")


def _whole_arm(name: str) -> Row:
    """Measure eight link capsules against twenty obstacles, and MuJoCo's distance for each pair."""
    from ...envs.mujoco_library import mujoco

    arm, body, q = _panda()
    rows = body.rows[[k for k, r in enumerate(body.rows) if r[BODY.frame] >= 0][:8]]
    eight = type(body)(rows, tuple(f"c{k}" for k in range(8)))
    obstacles = _spread(20, MIXED)
    g = robot_arrays((arm,), (eight,), pack(obstacles), settings=SafetySettings().packed(0.02))
    place_capsules(g, q, ROW.placed)
    model, data = _mujoco_twin(g[ROW.placed : ROW.placed + 8], rows[:, BODY.radius], obstacles)

    def theirs() -> float:
        return min(mujoco.mj_geomDistance(model, data, i, 8 + k, 10.0, None) for i in range(8) for k in range(20))

    placed = ROW.placed  # looked up once: the row is of the kernel
    ours, peer = seconds_per_call(lambda: clearance.min_slack(g, placed, 0.0, 10.0), theirs)
    note = f"{ours * 1e6:.2f} us against {peer * 1e6:.0f} us for 160 pairs"
    return row(name, ours / peer, "ratio", 0.1, note)


def _mujoco_twin(world: np.ndarray, radii: np.ndarray, obstacles: list[Obstacle]) -> tuple[Any, Any]:
    from ...envs.mujoco_library import compiled_model, mujoco

    geoms = [
        f'<geom type="capsule" size="{r}" fromto="{" ".join(str(v) for v in ends[:6])}"/>'
        for ends, r in zip(world, radii, strict=True)
    ]
    for each in obstacles:
        place = " ".join(str(v) for v in each.pose.position)
        if isinstance(each.shape, Box):
            size = " ".join(str(0.5 * v) for v in each.shape.size)
            geoms.append(f'<geom type="box" pos="{place}" size="{size}"/>')
        elif isinstance(each.shape, Capsule):
            geoms.append(f'<geom type="capsule" pos="{place}" size="{each.shape.radius} {each.shape.length / 2}"/>')
        elif isinstance(each.shape, Sphere):
            geoms.append(f'<geom type="sphere" pos="{place}" size="{each.shape.radius}"/>')
    model = compiled_model(f"<mujoco><worldbody>{''.join(geoms)}</worldbody></mujoco>")
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


def _demo(count: int) -> PosePath:
    """Return a demonstration of `count` poses: a lift, a carry and a descent."""
    s = np.linspace(0.0, 1.0, count)
    height = 0.1 * np.minimum(1.0, 4.0 * np.minimum(s, 1.0 - s))
    vectors = np.column_stack([0.4 * s - 0.2, 0.3 * s - 0.15, 0.95 + height, np.tile(DOWN, (count, 1))])
    return PosePath.from_vectors(vectors)


@cache
def problem() -> tuple[Planner, PosePath, np.ndarray, Pose, Obstacle]:
    """Return a planner, a demonstration of 100 poses, start joints, a goal and an obstacle on the path."""
    arm, body, q = _panda()
    goal = Pose.from_position_quaternion([0.05, 0.3, 0.95], DOWN)
    ball = Obstacle(Sphere(0.04), Pose.from_position_quaternion([-0.03, 0.15, 1.02]), name="ball")
    return Planner(arm, body), _demo(100), q, goal, ball


def _plan_row(name: str) -> Row:
    planner, demo, q, goal, ball = problem()
    try:
        import_module("ompl.base")
    except ImportError:
        return Row(name, None, "ratio", 0.5, None, "needs: pip install 'onedemo[ompl]'")
    settings = SafetySettings()
    g = robot_arrays(
        (planner.arm,), (planner.body,), pack([ball]), margin=settings.distance, settings=settings.packed(0.02)
    )
    plan = planner.plan(demo, q, goal, [ball])
    assert plan.success
    peer = ompl_solver(planner.arm, g, plan.joints[0], plan.joints[-1])
    mine, theirs = seconds_per_call(lambda: planner.plan(demo, q, goal, [ball]), peer)
    note = (
        f"{mine * 1e3:.2f} ms, {plan.how}, along the demonstration, against {theirs * 1e3:.2f} ms to the same posture"
    )
    return row(name, mine / theirs, "ratio", 0.5, note)


def _plan_slope(name: str) -> Row:
    planner, _, q, goal, _ = problem()
    sizes = np.array([50, 200, 800, 2000])
    demos = [_demo(int(n)) for n in sizes]
    return _slope(name, sizes, seconds_per_call(*(partial(planner.plan, demo, q, goal, []) for demo in demos)))


def _batch_row(name: str) -> Row:
    planner, demo, q, goal, ball = problem()
    rng = np.random.default_rng(0)
    goals = [
        Pose.from_position_quaternion(goal.position + rng.uniform(-0.1, 0.1, 3), goal.quaternion) for _ in range(64)
    ]
    problems = [PlanRequest(demo, q, each, (ball,), seed=k) for k, each in enumerate(goals)]
    one, two = seconds_per_call(*(partial(plan_batch, problems, planner.arm, planner.body, workers=n) for n in (1, 2)))
    return row(name, two / one, "ratio", 1 / 1.7, f"{two * 1e3:.0f} ms against {one * 1e3:.0f} ms")


def _depth_slope(name: str) -> Row:
    """Measure how the cost of a tree in a closed cage grows with its levels, with a fixed beam."""
    half, walls = 0.5, []
    for axis in range(3):
        for sign in (-1.0, 1.0):
            size, place = [2 * half + 0.02] * 3, [0.0, 0.0, 0.0]
            size[axis], place[axis] = 0.02, sign * half
            walls.append(Obstacle(Box((size[0], size[1], size[2])), Pose.from_position_quaternion(place)))
    path = PosePath.from_vectors([[0, 0, 0, 1, 0, 0, 0], [2, 0, 0, 1, 0, 0, 0]])
    levels = np.array([2, 6, 12, 24])

    def run(count: int) -> Callable[[], object]:
        settings = RepetSettings(levels=count, beam=4, retries=0, cell=0.05, nodes=20_000)
        return lambda: escape_path(path, point_tool(0.02), walls, settings)

    return _slope(name, levels, seconds_per_call(*(run(int(n)) for n in levels)))


def _named(name: str, function: Callable[..., Row], *arguments: Any) -> tuple[str, Callable[[], Row]]:
    return name, partial(function, name, *arguments)


LINES: dict[str, Callable[[], Row]] = dict(
    [
        _named("segment-sphere distance / Pinocchio FK + Jacobian", _query, Sphere(0.1)),
        _named("segment-box distance / Pinocchio FK + Jacobian", _query, Box((0.2, 0.1, 0.3))),
        _named("segment-capsule distance / Pinocchio FK + Jacobian", _query, Capsule(0.05, 0.2)),
        _named("escape-tree level, spheres / Pinocchio FK + Jacobian", _level, Sphere(0.1), 0.3),
        _named("escape-tree level, boxes / Pinocchio FK + Jacobian", _level, Box((0.2, 0.1, 0.3)), 0.75),
        _named("8 capsules x 20 obstacles / mj_geomDistance per pair", _whole_arm),
        _named("safe tick from Python, 1 obstacle / DQ_Robotics", _tick_row, 1),
        _named("safe tick from Python, 20 obstacles / DQ_Robotics", _tick_row, 20),
        _named("safe tick, 20 obstacles / none", _tick_growth),
        _named("safe tick, growth over 1 to 100 obstacles", _tick_slope),
        _named("escape tree, growth over 2 to 24 levels", _depth_slope),
        _named("plan, growth over 50 to 2000 poses", _plan_slope),
        _named("plan, 100 poses, 1 obstacle / OMPL RRT-Connect", _plan_row),
        _named("64 plans on 2 cores / on 1", _batch_row),
    ]
)
"""Measurements by name."""
