"""Measurement of an arm's hulls among obstacles that are so close that the capsules do not decide."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from ...envs import ROBOTS
from ...planner import Arm, Body, Obstacle, Pose, Sphere
from ...planner.collision import clearance
from ...planner.collision.capsule_placement import place_capsules
from ...planner.collision.robot_arrays import ROW, robot_arrays
from ...planner.geometry.shapes import pack
from ...planner.robot.body import BODY
from ...planner.robot.joint_frames import joint_frames, moved
from .measuring import Row, row, seconds_per_call

NAME = "arm of hulls near 12 balls / MuJoCo's collisions"
BALLS, RADIUS = 12, 0.05
GAP, WIDE = 0.005, 0.02
"""Distance [m] of each ball from a corner of a hull, half of it from all; distance of a contact of MuJoCo."""


def _near_contact() -> Row:
    """Measure the smallest slack of the UR5e, and MuJoCo's contacts of the same hulls with the same balls."""
    from ...envs.mujoco_library import mujoco

    arm, body, q = _robot()
    hulls = _hulls(arm, body, q)
    balls = _balls(arm, body, q, hulls)
    g = robot_arrays((arm,), (body,), pack(balls), margin=0.0)
    place_capsules(g, q, ROW.placed)
    placed = ROW.placed  # looked up once: the row is of the kernel
    model, data = _twin(hulls, balls)
    ours, theirs = seconds_per_call(
        lambda: clearance.min_slack(g, placed, 0.0, 0.1), lambda: mujoco.mj_collision(model, data)
    )
    note = (
        f"{ours * 1e6:.2f} us for {len(hulls)} hulls, {1e3 * clearance.min_slack(g, placed, 0.0, 0.1):.1f} mm from the "
        f"nearest ball, against {theirs * 1e6:.2f} us for {data.ncon} contacts within {1e3 * WIDE:.0f} mm"
    )
    return row(NAME, ours / theirs, "ratio", 1.0, note)


def _robot() -> tuple[Arm, Body, np.ndarray]:
    """Return arm, body and usual joints (6,) [rad] of the UR5e."""
    from ...envs.scene.robot_bodies import robot_body
    from ...envs.scene.scene import compiled_scene

    scene = compiled_scene(ROBOTS["UR5e"])
    return scene.arms[0].arm, robot_body(ROBOTS["UR5e"]), np.array(scene.home[0])


def _hulls(arm: Arm, body: Body, q: np.ndarray) -> list[np.ndarray]:
    """Return the corners (n, 3) of the hulls that move, in the world [m]."""
    frames, known = joint_frames(arm, q), {}
    for frame, hull in zip(body.rows[:, BODY.frame], body.hulls, strict=True):
        if hull is not None and frame >= 0:
            known[id(hull)] = moved(frames[int(frame)], hull.corners)
    return list(known.values())


def _balls(arm: Arm, body: Body, q: np.ndarray, hulls: list[np.ndarray]) -> tuple[Obstacle, ...]:
    """Return balls at the gap from corners of hulls, and at least half of it from all hulls."""
    rng, found = np.random.default_rng(0), []
    while len(found) < BALLS:
        corners = hulls[int(rng.integers(len(hulls)))]
        corner = corners[int(rng.integers(len(corners)))]
        out = corner - corners.mean(axis=0)
        place = corner + (RADIUS + GAP) * out / np.linalg.norm(out)
        ball = Obstacle(Sphere(RADIUS), Pose.from_position_quaternion(place, [1.0, 0.0, 0.0, 0.0]))
        alone = robot_arrays((arm,), (body,), pack((ball,)), margin=0.0)
        if clearance.slack_at(alone, q, 0.0, 0.1) > 0.5 * GAP:
            found.append(ball)
    return tuple(found)


def _twin(hulls: list[np.ndarray], balls: tuple[Obstacle, ...]) -> tuple[Any, Any]:
    """Return MuJoCo's model and data of one body of all hulls among the balls."""
    from ...envs.mujoco_library import compiled_model, mujoco

    meshes = [
        f'<mesh name="m{k}" vertex="{" ".join(f"{v:.9g}" for v in corners.ravel())}"/>'
        for k, corners in enumerate(hulls)
    ]
    geoms = [f'<geom type="mesh" mesh="m{k}" margin="{WIDE}" mass="1"/>' for k in range(len(hulls))]
    spheres = [
        f'<geom type="sphere" size="{RADIUS}" pos="{" ".join(f"{v:.9g}" for v in ball.pose.position)}"/>'
        for ball in balls
    ]
    model = compiled_model(
        f"<mujoco><asset>{''.join(meshes)}</asset><worldbody>{''.join(spheres)}"
        f"<body><freejoint/>{''.join(geoms)}</body></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    return model, data


NEAR_LINES: dict[str, Callable[[], Row]] = {NAME: _near_contact}
