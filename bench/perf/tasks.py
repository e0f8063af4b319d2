"""Speeds of the environments: steps against the bare physics, resets, vector workers."""

from __future__ import annotations

import os
from collections.abc import Callable
from functools import partial
from itertools import cycle
from typing import Any

import numpy as np

from ...configs.run_config import FAMILIES
from ...envs import TASKS
from .measuring import Row, row, seconds_per_call

SWAY_STEPS = 50
"""Control steps per sway of the arm in the measured scene."""
POUR = "Pour step, 30 beads / Stack step"
OWN = [task for task in TASKS if task not in FAMILIES]
"""Tasks of our own: robosuite's judge looks at every state, and its layouts settle, at robosuite's speed."""
TRAINED = ("reach", "place_one")
TRAINING_STEPS = 1500
"""Required number of 50 ms steps per second on one core."""
MORE = 4
"""Number of further environments over which memory growth is averaged."""
WORKERS = "step of two vector workers, per environment / of one"


def started(task: str, **options: Any) -> Any:
    """Build the environment of a task and reset it with seed 0.

    Args:
        task: name of the task.
        options: arguments of the environment.
    """
    import gymnasium as gym

    from ... import envs  # noqa: F401  (registers the ids)

    env: Any = gym.make(TASKS[task].id, **options).unwrapped
    env.reset(seed=0)
    return env


def swaying(env: Any) -> np.ndarray:
    """Return actions (SWAY_STEPS, entries) that sway all joints and leave the grippers alone."""
    sway = np.sin(2.0 * np.pi * np.arange(SWAY_STEPS) / SWAY_STEPS)
    rows = np.ones((len(env.arms), len(env.action_space.low) // len(env.arms)))
    rows[:, -1] = 0.0
    return 0.1 * sway[:, None] * rows.ravel()


def _step(task: str, name: str) -> Row:
    """Measure a user's step against MuJoCo alone, in two scenes with the same motion and the same controls."""
    from ...envs.mujoco_library import mujoco

    # joint velocities: twists depend on the arm's pose, so a second sway would have other controls
    env, bare = (started(task, control_mode="joint_velocity") for _ in range(2))
    model, data, substeps = bare.sim.model, bare.sim.data, env.substeps
    actions, controls = swaying(env), []
    for action in actions:
        env.step(action)
        controls.append(env.sim.data.ctrl.copy())
    env.reset(seed=0)
    ours, theirs = cycle(actions), cycle(controls)

    def step() -> None:
        env.step(next(ours))

    def raw() -> None:
        data.ctrl[:] = next(theirs)
        mujoco.mj_step(model, data, substeps)

    mine, physics = seconds_per_call(step, raw, together=True)
    assert np.array_equal(env.sim.data.qpos, data.qpos), "the two scenes have diverged"
    note = (
        f"{mine * 1e3:.3f} ms against {physics * 1e3:.3f} ms for {substeps} substeps; two scenes with swaying arms, "
        "from the same start, under the same controls, to the same bits"
    )
    return row(name, mine / physics, "ratio", 1.15, note)


def _reset(task: str, name: str) -> Row:
    env = started(task)
    (seconds,) = seconds_per_call(lambda: env.reset())
    return row(name, seconds * 1e3, "ms", 3.0 if task == "stack" else 5.0)


def _pour() -> Row:
    pour, stack = started("pour"), started("stack")
    full, light = (cycle(swaying(env)) for env in (pour, stack))
    mine, theirs = seconds_per_call(lambda: pour.step(next(full)), lambda: stack.step(next(light)))
    note = f"{mine * 1e3:.2f} ms against {theirs * 1e3:.2f} ms per 50 Hz step"
    return row(POUR, mine / theirs, "ratio", 8.0, note)


def _workers() -> Row:
    import gymnasium as gym

    make = partial(gym.make, f"onedemo.envs:{TASKS['stack'].id}")
    one, two = (gym.vector.AsyncVectorEnv([make] * count) for count in (1, 2))
    steps = []
    for vector in (one, two):
        vector.reset(seed=0)
        action = np.zeros(vector.action_space.shape or ())
        steps.append(partial(vector.step, action))
    alone, both = seconds_per_call(*steps)
    for vector in (one, two):
        vector.close()
    note = f"{both * 5e5:.0f} us against {alone * 1e6:.0f} us; with fork, on this machine's cores"
    return row(WORKERS, 0.5 * both / alone, "ratio", 1 / 1.7, note)


def _training(task: str, name: str) -> Row:
    """Measure whole episodes of random twists at 20 Hz, resets included, as a learner uses the environment."""
    env, rng = started(task), np.random.default_rng(0)
    actions = rng.uniform(-1.0, 1.0, (TASKS[task].steps, *env.action_space.shape))

    def episode() -> None:
        env.reset(seed=0)
        for action in actions:
            env.step(action)

    (seconds,) = seconds_per_call(episode)
    each = seconds / len(actions)
    return row(name, each * 1e3, "ms", 1e3 / TRAINING_STEPS, f"{1.0 / each:.0f} steps of 50 ms per second, one core")


def _memory(task: str, name: str) -> Row:
    """Measure the memory that each further environment of a process takes."""
    kept = [started(task)]
    before = _resident()
    kept += [started(task) for _ in range(MORE)]
    return row(name, (_resident() - before) / MORE, "MB", 120.0, f"of {len(kept)} in one process")


def _resident() -> float:
    """Return the resident memory of this process [MB]."""
    with open("/proc/self/statm", encoding="ascii") as file:
        return int(file.read().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6


def step_line(task: str) -> str:
    """Return the name of the measurement of a task's step."""
    return f"{_short(task)} step / raw mj_step"


def training_line(task: str) -> str:
    """Return the name of the measurement of a task's step as a learner uses it."""
    return f"{_short(task)} step at 20 Hz, resets included"


def _short(task: str) -> str:
    return TASKS[task].id.split("/")[1].split("-")[0]


TASK_LINES: dict[str, Callable[[], Row]] = {
    **{step_line(task): partial(_step, task, step_line(task)) for task in OWN},
    **{f"{_short(task)} soft reset": partial(_reset, task, f"{_short(task)} soft reset") for task in OWN},
    **{training_line(task): partial(_training, task, training_line(task)) for task in TRAINED},
    **{f"{_short(task)}, a further one": partial(_memory, task, f"{_short(task)}, a further one") for task in TRAINED},
    POUR: _pour,
    WORKERS: _workers,
}
"""Measurements by name."""
