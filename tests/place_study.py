"""Where a robot can pour or shelve: random places, the best by reach: `python tests/place_study.py --help`.

Of every candidate the demonstrated way must be reachable with room to the joints' limits; those that remain are ranked
by the share of the starts of L2 that are within reach, see `reach`.
"""

from __future__ import annotations

import argparse
from collections.abc import Iterator
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from helpers.reach import TURNS, PourReach, ShelfReach, up

from onedemo.envs.pour.geometry import grasp
from onedemo.envs.pour.layout import fits
from onedemo.envs.pour.places import SLIM, WIDE, PourPlaces
from onedemo.envs.scene.robots import ROBOTS
from onedemo.envs.shelve.layout import RANGES as SHELF_RANGES
from onedemo.envs.shelve.layout import ShelfLayout, shelf_layout
from onedemo.envs.shelve.parts import DEPTH, SIDE, WIDTH
from onedemo.envs.shelve.places import ShelfPlaces
from onedemo.planner.geometry.pose import Pose, PosePath
from onedemo.planner.geometry.shapes import Obstacle

ROOM = 0.03
"""Least room [m] of the arm at the start."""
LIFT, SHORT = 0.15, 0.20
"""Ways [m] of the hand up from the stand, and from the start to it."""
PILE, BESIDE = ShelfPlaces.pile, 0.28
"""Where books wait, and how far from there the stand is [m]."""
IN_FRONT = 0.15
"""Least way [m] of the stand before the cupboard: a book in the hand has room."""
HEIGHTS = (0.95, 1.0, 1.05)
"""Of the tops of the glasses' stands [m]."""
TRIES = 25
"""Stands that are tried for each posture before a cupboard, and seeds for the postures."""


class Found(NamedTuple):
    """Places, and what they are worth.

    Attributes:
        value: the larger the better.
        shares: of the starts that are within reach, as `reach` gives them.
        places: them.
    """

    value: float
    shares: tuple[float, ...]
    places: PourPlaces | ShelfPlaces


def pouring(robot: str, tries: int, rng: np.random.Generator) -> Iterator[Found]:
    """Random places to pour at."""
    reach, source = PourReach(robot), WIDE if 2.0 * WIDE.radius <= ROBOTS[robot].grip[1] else SLIM
    axis = reach.arm.chain[0, 4:6]
    for _ in range(tries):
        tops = np.column_stack([rng.uniform([-0.2, -0.25], [0.2, 0.25], (2, 2)), np.full(2, rng.choice(HEIGHTS))])
        if not fits(tops, axis, 0.22):
            continue
        yaw, other = rng.choice(TURNS[:7], 2)
        hand = grasp(source, tops[0] + [0.0, 0.0, 0.5 * source.height], yaw)
        ready = reach.solved(hand @ up(-0.15), reach.home + rng.normal(0.0, 0.8, reach.arm.dof))
        if ready is None:
            continue
        around = reach.glass_and_stands(tops)
        places = PourPlaces(tuple(map(tuple, tops.round(3).tolist())), tuple(ready.round(3).tolist()), source)
        standing = Obstacle(source.shape, Pose.from_position_quaternion(tops[0]) @ up(0.5 * source.height))
        if reach.slack(reach.among([*around, standing]), ready) < ROOM:
            continue
        work = reach.among(around)
        fetched = reach.fetched(places, tops, yaw, ready, work)
        if fetched is None or reach.emptied(places, tops, other, fetched, work) is None:
            continue
        if reach.share(places, "L2", 8)[0] >= 0.7:
            shares = reach.share(places, "L2", 40, seed=1)
            yield Found(shares[0] + 0.5 * shares[1], shares, places)


def shelving(robot: str, tries: int, rng: np.random.Generator) -> Iterator[Found]:
    """Random places to shelve at: cupboards first, then stands for the postures before them."""
    reach = ShelfReach(robot)
    for _ in range(tries):
        yaw = rng.uniform(0.0, np.deg2rad(150.0))
        front = rng.uniform([-0.25, -0.3], [0.2, 0.3])
        if not _stands_on_table(front, yaw):
            continue
        for q in _before_slots(reach, front, yaw, rng):
            for _ in range(TRIES):
                spot = rng.uniform([-0.3, -0.33, 1.10], [0.3, 0.33, 1.18])
                before = (Pose.from_yaw([*front, 0.0], yaw).inverse() @ Pose.from_position_quaternion(spot)).position[0]
                if before > -IN_FRONT or np.hypot(*(spot[:2] - PILE)) < BESIDE:
                    continue
                places = ShelfPlaces(
                    tuple(spot.round(3).tolist()), yaw + np.deg2rad(rng.uniform(-110.0, 60.0)), tuple(front), yaw, ()
                )
                ready = _before_stand(reach, places, q)
                if ready is None:
                    continue
                places = replace(places, ready=tuple(ready.round(3).tolist()))
                if reach.share(places, "L2", 6) >= 0.5:
                    shares = (reach.share(places, "L2", 24, seed=1), reach.share(places, "L1", 6, "lower", seed=2))
                    yield Found(shares[0] + 0.2 * shares[1], shares, places)


def _stands_on_table(front: np.ndarray, yaw: float) -> bool:
    """A cupboard is not far over the table's edge, and not on the pile."""
    cupboard, wide = Pose.from_yaw([*front, 0.0], yaw), 0.5 * WIDTH + SIDE
    corners = [Pose.from_position_quaternion([x, y, 0.0]) for x in (0.0, DEPTH) for y in (-wide, wide)]
    x, y, _ = (cupboard.inverse() @ Pose.from_position_quaternion([*PILE, 0.0])).position
    on_pile = -0.17 < x < DEPTH + 0.2 and abs(y) < wide + 0.15
    return not on_pile and max(np.abs((cupboard @ each).position[:2]).max() for each in corners) < 0.43


def _drawn(places: ShelfPlaces, reach: ShelfReach) -> ShelfLayout:
    return shelf_layout(np.random.default_rng(0), SHELF_RANGES["L0"], places, 3, (1, reach.arm.dof))


def _before_slots(reach: ShelfReach, front: np.ndarray, yaw: float, rng: np.random.Generator) -> list[np.ndarray]:
    """Postures before the middle slot of the upper shelf from which all three books can be inserted."""
    aside = tuple((front - 2.0 * np.array([np.cos(yaw), np.sin(yaw)])).tolist())
    drawn = _drawn(ShelfPlaces((*aside, 1.1), yaw, tuple(front), yaw, ()), reach)
    goals, work, found = (
        [Pose.from_vector(goal) for goal in drawn.goals("upper")],
        reach.among(reach.furniture(drawn)),
        [],
    )
    for _ in range(TRIES):
        q = reach.solved(reach.before(goals[1]), reach.home + rng.normal(0.0, 0.8, reach.arm.dof))
        if q is None or reach.slack(work, q) < ROOM or any(np.abs(q - other).max() < 0.1 for other in found):
            continue
        ways = [reach.to([reach.before(goal), *reach.insertion(goal)], q, work) for goal in goals]
        if all(way is not None for way in ways):
            found.append(q)
    return found


def _before_stand(reach: ShelfReach, places: ShelfPlaces, q: np.ndarray) -> np.ndarray | None:
    """Joints at the start, from those before the middle slot: all of the way back; None if that cannot be."""
    drawn = _drawn(places, reach)
    work, loaded = reach.works(drawn)
    hand, before = drawn.handed(0) @ reach.grasp, reach.before(Pose.from_vector(drawn.goals("upper")[1]))
    back = PosePath(reach.carried(up(LIFT) @ hand, before).dqs[::-1])
    lifted = reach.along(back, q, loaded)
    ready = reach.to([hand, hand @ up(-SHORT)], lifted, work)
    return ready if ready is not None and reach.slack(work, ready) >= 0.01 else None


def main() -> None:
    """Print the best places that were found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", choices=["pour", "shelve"])
    parser.add_argument("robot", choices=sorted(ROBOTS))
    parser.add_argument("--tries", type=int, default=10_000, help="random candidates (a cupboard counts as one)")
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args()
    search = pouring if options.task == "pour" else shelving
    best: list[Found] = []
    for found in search(options.robot, options.tries, np.random.default_rng(options.seed)):
        best = sorted([*best, found], key=lambda each: -each.value)[:5]
    for each in best:
        print(f"{each.shares} {each.places}")


if __name__ == "__main__":
    main()
