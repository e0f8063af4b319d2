"""Demonstrations made of straight lines, in which the truth about every grasp and release is known."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Box, Cylinder, Obstacle
from onedemo.planner.imitation.demonstration import Demonstration
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.skills.thing import Thing

DT = 0.05
DOWN = [0.0, 1.0, 0.0, 0.0]
"""Orientation wxyz of a hand that points down."""


class Move(NamedTuple):
    """A straight motion of the hand in a number of samples, then a pause with a gripper command.

    Attributes:
        to: pose of the tcp at the end.
        samples: of the motion.
        gripper: command afterwards, 1 closes.
        pause: samples of standing still with it.
    """

    to: Pose
    samples: int = 30
    gripper: float = -1.0
    pause: int = 12


def hand(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """Pose of a hand that points down."""
    return Pose.from_yaw([x, y, z], yaw) @ Pose.from_position_quaternion([0, 0, 0], DOWN)


def at(x: float, y: float, z: float, yaw: float = 0.0) -> Pose:
    """Pose of an upright thing."""
    return Pose.from_yaw([x, y, z], yaw)


def demonstrated(
    start: Pose,
    moves: Sequence[Move],
    objects: Mapping[str, Pose],
    *,
    held: Mapping[int, str] | None = None,
    falls: Mapping[int, Pose] | None = None,
    fixtures: Mapping[str, Pose] | None = None,
    joints: Mapping[str, np.ndarray] | None = None,
) -> Demonstration:
    """Return the demonstration of some moves.

    Args:
        start: first pose of the tcp.
        moves: motions of the hand.
        objects: where objects lie at first.
        held: name of the object that is in the hand during a move, by the number of the move.
        falls: pose at which the object comes to rest that is let go after a move, by its number; else where it is.
        fixtures: what stands still.
        joints: positions of joints of the scene.
    """
    tcp, gripper, paths = [start.dq], [-1.0], {name: [pose.dq] for name, pose in objects.items()}
    now, command, last = dict(objects), -1.0, start
    for number, move in enumerate(moves):
        name, line = (held or {}).get(number), screw_path(last, move.to, 1e-3)
        picks = np.linspace(0, len(line) - 1, move.samples + 1).round().astype(int)[1:]
        in_hand = None if name is None else last.inverse() @ now[name]
        for k in picks:
            tcp.append(line[int(k)].dq)
            gripper.append(command)
            if name is not None and in_hand is not None:
                now[name] = line[int(k)] @ in_hand
            for each in paths:
                paths[each].append(now[each].dq)
        command = move.gripper
        if name is not None and number in (falls or {}):
            now[name] = (falls or {})[number]
        for _ in range(move.pause):
            tcp.append(move.to.dq)
            gripper.append(command)
            for each in paths:
                paths[each].append(now[each].dq)
        last = move.to
    count = len(tcp)
    return Demonstration(
        name="shown",
        task="",
        robot="Panda",
        tcp_frame="grip_site",
        source="scripted",
        licence="MIT",
        time=DT * np.arange(count),
        path=PosePath(np.array(tcp)),
        gripper=np.array(gripper),
        object_paths={name: PosePath(np.array(path)) for name, path in paths.items()},
        fixtures=dict(fixtures or {}),
        other_joints={name: np.resize(values, count) for name, values in (joints or {}).items()},
    )


def box(name: str, *size: float, free: bool = True) -> Thing:
    """A thing of one box."""
    return Thing(name, (Obstacle(Box(tuple(size))),), free)  # type: ignore[arg-type]


def can(name: str, radius: float, height: float) -> Thing:
    """A thing of one cylinder."""
    return Thing(name, (Obstacle(Cylinder(radius, height)),))


def pick_and_place(goal: Pose, rest: Pose | None = None, **others: Pose) -> Demonstration:
    """A cube at (0.4, 0.1), 40 mm wide, is fetched from the table (z = 0) and let go at a pose."""
    cube = at(0.4, 0.1, 0.02)
    grasp = hand(0.4, 0.1, 0.02)
    above = hand(0.4, 0.1, 0.15)
    place = goal @ cube.inverse() @ grasp
    over = Pose.from_position_quaternion([0, 0, 0.1]) @ place
    moves = [
        Move(grasp, 40, 1.0),
        Move(above, 20, 1.0, 0),
        Move(over, 30, 1.0, 0),
        Move(place, 20, -1.0),
        Move(over, 20),
    ]
    held = {1: "cube", 2: "cube", 3: "cube"}
    falls = {} if rest is None else {3: rest}
    return demonstrated(hand(0.3, -0.1, 0.3), moves, {"cube": cube, **others}, held=held, falls=falls)


def is_near(one: Pose, other: Pose, distance: float = 1e-5, angle: float = 1e-4) -> bool:
    """Return whether two poses are about the same."""
    gap, turn = one.distance_to(other)
    return gap <= distance and turn <= angle
