"""Time of decisions and of whole ticks in multiples of one fixed compiled loop, so that machines can be compared."""

from __future__ import annotations

import math
import statistics
from collections.abc import Callable
from contextlib import suppress
from functools import cache, partial
from time import process_time
from typing import NamedTuple

import numpy as np

from ...baselines.programs.goal_choice import ChosenMotion, MotionChoice, choose
from ...configs import RunConfig
from ...envs.errors import NoRoom
from ...planner import Obstacle, Pose, PosePath, ReactivePlanner, Sphere, imitated_path
from ...planner.resumable import finished
from .fixed_loop import unit
from .measuring import Row, row, seconds_per_call
from .planner import problem

UNIT = "loops"
GOALS = 12
"""Number of goals of a choice: grasps of a block, each a turn apart."""
SWINGS = 8
"""Number of times that the ball swings across the path."""
WINDOW = 10
"""Ticks between two decisions while something moves, see `motion_state.DECIDE`."""
EPISODES = 20
"""Number of episodes of each cell."""
TASKS, LEVELS = ("stack", "pour", "shelve"), ("L3", "L4", "F")
CHOOSE = f"choice among {GOALS} goals / the fixed loop"
DECIDE = "decision beside a mover, its longest tick / the fixed loop"
LIMITS = {"99.9 %": 5.0, "longest": 20.0}
"""Limits of the ticks of whole episodes."""


def _in_loops(name: str, seconds: float, goal: float, note: str) -> Row:
    """Return a row in units of the fixed loop, which is measured anew."""
    loop = unit()
    return row(name, seconds / loop, UNIT, goal, f"{note}; the loop took {loop * 1e3:.2f} ms of CPU time")


def _choose() -> Row:
    """Measure a choice among grasps that look alike, beside a ball, each with a motion that follows."""
    planner, demo, q, goal, ball = problem()
    turns = [Pose.from_yaw([0.0, 0.0, 0.0], 2.0 * math.pi * k / GOALS) @ goal for k in range(GOALS)]
    goals = tuple(Pose.from_position_quaternion(goal.position, turn.quaternion) for turn in turns)
    beyond = Pose.from_position_quaternion(goal.position + np.array([0.0, -0.2, 0.1]), goal.quaternion)
    carry = MotionChoice("carry", demo, (beyond,), planner.body, (ball,))
    reach = MotionChoice("reach", demo, goals, planner.body, (ball,))

    def call() -> ChosenMotion:
        return finished(choose(planner.arm, planner.settings, q, reach, lambda index: carry))

    assert call().complete, "then nothing is searched in joint space"
    (seconds,) = seconds_per_call(call, clock=process_time)
    return _in_loops(CHOOSE, seconds, 10.0, f"{seconds * 1e3:.1f} ms with the motion that follows")


def _decide() -> Row:
    """Measure the decisions of a follower beside a ball that swings across its path: to go on, to wait or to go round.

    Where no conflict is predicted, there is little to decide: the value is that of the tenth that takes longest.
    """
    planner, demo, q, goal, _ = problem()
    path, seconds = imitated_path(demo, goal), []
    for turn in range(SWINGS + 1):
        spent = _ticks_beside_a_mover(ReactivePlanner(planner.arm, planner.body), path, q, 0.7 * turn)
        windows = [max(spent[k : k + WINDOW]) for k in range(1, len(spent) - WINDOW, WINDOW)]
        seconds += windows if turn else []  # the first one loads compiled code
    most, middle = float(np.quantile(seconds, 0.9)), statistics.median(seconds)
    note = f"90 % of {len(seconds)} take at most {most * 1e3:.1f} ms, half {middle * 1e3:.1f} ms"
    return _in_loops(DECIDE, most, 4.0, note)


def _ticks_beside_a_mover(follower: ReactivePlanner, path: PosePath, start: np.ndarray, phase: float) -> list[float]:
    """Return the CPU time [s] of every tick along a path across which a ball swings."""
    q, dt = start.copy(), follower.settings.plan.motion.dt
    spent: list[float] = []
    follower.go(path)
    for tick in range(300):
        angle = phase + 1.5 * dt * tick
        place = Pose.from_position_quaternion([-0.03, 0.15 + 0.15 * math.sin(angle), 1.0])
        ball = Obstacle(Sphere(0.04), place, np.array([0.0, 0.225 * math.cos(angle), 0.0]), name="ball")
        before = process_time()
        follower.see([ball])
        command = follower.step(q)
        spent.append(process_time() - before)
        if command.state in ("done", "failed"):
            break
        q = q + dt * command.velocity
    return spent


class _Ticks(NamedTuple):
    """CPU times of the ticks of a cell in loops: median, 99 %, 99.9 %, longest; their number; the loop [s]."""

    median: float
    most: float
    nearly_all: float
    longest: float
    count: int
    loop: float


@cache
def _episodes(task: str, level: str) -> _Ticks:
    """Play the episodes of a cell and return the CPU times of the policy's answers."""
    from ..episodes.episode import play, rehearse
    from ..episodes.scenarios import scenarios_of
    from ..run.episode_jobs import made, policy_for

    config = RunConfig(name="perf", task=task, demonstration=task, level=level, episodes=EPISODES, seed=1000)
    env = made(config)
    policy, spent, loops = policy_for(env, config), [], [unit()]
    rehearse(env, policy, config)
    for scenario in scenarios_of(config):
        with suppress(NoRoom):  # a start that leaves no space for the obstacles
            spent += play(env, policy, scenario).world.cpu_seconds
            loops.append(unit())
    env.close()
    loop = statistics.median(loops)
    values = np.array(spent) / loop
    middle, most, nearly_all = (float(np.quantile(values, share)) for share in (0.5, 0.99, 0.999))
    return _Ticks(middle, most, nearly_all, float(values.max()), len(spent), loop)


def _ticks(task: str, level: str, which: str, name: str) -> Row:
    """Measure the ticks of whole episodes."""
    found = _episodes(task, level)
    note = (
        f"of {found.count} ticks of {EPISODES} episodes: median {found.median:.3f}, 99 % {found.most:.2f}, 99.9 % "
        f"{found.nearly_all:.2f}, longest {found.longest:.1f}; the loop took {found.loop * 1e3:.2f} ms of CPU time"
    )
    value = found.longest if which == "longest" else found.nearly_all
    return row(name, value, UNIT, LIMITS[which], note)


def _name(task: str, level: str, which: str) -> str:
    return f"{task} {level}, ticks of {EPISODES} episodes, {which} / the fixed loop"


THINKING_LINES: dict[str, Callable[[], Row]] = {CHOOSE: _choose, DECIDE: _decide}
LONG_LINES: dict[str, Callable[[], Row]] = {
    _name(task, level, which): partial(_ticks, task, level, which, _name(task, level, which))
    for task in TASKS
    for level in LEVELS
    for which in LIMITS
}
"""Measurements by name; the long ones are of whole episodes."""
