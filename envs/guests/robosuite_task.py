"""robosuite's environments of its own tasks, with the servos and obstacles of this project.

They draw starts, judge states and give the model; the physics is `Simulation`'s.
"""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any, NamedTuple

import numpy as np
import robosuite
from robosuite.environments.base import REGISTERED_ENVS
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.environments.manipulation.two_arm_env import TwoArmEnv
from robosuite.utils.log_utils import ROBOSUITE_DEFAULT_LOGGER

from ...planner.errors import BadOption, UnknownName
from ..scene.mjcf_parts import obstacle_bodies
from ..scene.servos import leave_out_unused, mend_robot, use_velocity_servos
from .task_facts import REFUSED, WideRange

PREFIX = "OneDemo"
"""Prefix of the names under which robosuite registers classes of this project."""
MOST_DRAWS = 1000
"""Largest number of layouts drawn until the distances are kept."""
ASIDE, NEXT, ABOVE_FLOOR = (1.6, 1.6), 0.4, 0.001
"""Place x, y [m] on the floor of objects that take no part, distance to the next one in x, and gap below [m]."""


class Layout(NamedTuple):
    """Layout that robosuite has drawn.

    Attributes:
        qpos: (nq,) positions of all joints; those of the robot are of no use.
        body_pos: (nbody, 3) positions of the bodies in their parents [m]: fixtures may have been moved.
        body_quat: (nbody, 4) rotations, likewise, wxyz.
    """

    qpos: np.ndarray
    body_pos: np.ndarray
    body_quat: np.ndarray


class GuestTask:
    """Additions to one of robosuite's tasks: mixed in before its class.

    Attributes:
        cleared: names of the objects that take no part in the present layout.
    """

    slots = 0
    cleared: tuple[str, ...] = ()
    model: Any
    robots: Any
    sim: Any
    rng: Any

    def _load_model(self) -> None:
        super()._load_model()  # type: ignore[misc]
        self.model.worldbody.extend(obstacle_bodies(self.slots))
        mend_robot(self.model.root)
        use_velocity_servos(self.model.root, set(self.robots[0].robot_model.joints))
        leave_out_unused(self.model.root)

    def clear_objects(self, object_names: Any) -> None:
        """Stand objects that take no part on the floor, far from the robot; robosuite drops them from 10 m."""
        names = {object_names} if isinstance(object_names, str) else set(object_names)
        away = [each for each in self.model.mujoco_objects if each.name in names]
        for k, each in enumerate(away):
            place = (ASIDE[0] + NEXT * k, ASIDE[1], ABOVE_FLOOR - float(each.bottom_offset[-1]))
            self.sim.data.set_joint_qpos(each.joints[0], np.array([*place, 1.0, 0.0, 0.0, 0.0]))
        self.cleared = tuple(each.name for each in away)

    def keep_nominal(self) -> None:
        """Remember where the fixtures of the compiled model stand."""
        model = self.sim.model
        self._nominal = model.body_pos.copy(), model.body_quat.copy()
        for sampler in _samplers(getattr(self, "placement_initializer", None)):
            sampler.rng = self.rng  # a sampler that was given none draws without a seed

    def drawn(self, seed: int, wide: WideRange | None) -> Layout:
        """Draw a layout; the same seed gives the same one.

        Args:
            seed: seed of the layout.
            wide: wider ranges, or None for robosuite's own.

        Raises:
            BadOption: no layout keeps the distances of the wider ranges.
        """
        self.rng.bit_generator.state = np.random.default_rng(seed).bit_generator.state
        for _ in range(MOST_DRAWS):
            self.cleared = ()
            model, (places, turns) = self.sim.model, self._nominal
            model.body_pos[:], model.body_quat[:] = places, turns
            self.sim.reset()
            with self._one_object(), _widened(getattr(self, "placement_initializer", None), wide):
                self._reset_internal()  # type: ignore[attr-defined]
            self._move_fixtures(wide)
            if wide is None or self._far_apart(wide):
                return Layout(self.sim.data.qpos.copy(), model.body_pos.copy(), model.body_quat.copy())
        raise BadOption("range", f"no start keeps {wide.apart:g} m between objects and fixtures" if wide else "")

    @contextmanager
    def _one_object(self) -> Iterator[None]:
        """Draw the one object that takes part here: robosuite chooses from a set, whose order is the process's."""
        if getattr(self, "single_object_mode", 0) != 1:
            yield
            return
        things = self.nuts if hasattr(self, "nuts") else self.objects  # type: ignore[attr-defined]
        self.nut_id = self.object_id = int(self.rng.integers(len(things)))
        self.single_object_mode = 2
        try:
            yield
        finally:
            self.single_object_mode = 1

    def _move_fixtures(self, wide: WideRange | None) -> None:
        for name, bounds in wide.fixture.items() if wide else ():
            place = self.sim.model.body_pos[self.sim.model.body_name2id(name)]
            place[:2] = [self.rng.uniform(*each) for each in bounds]

    def _far_apart(self, wide: WideRange) -> bool:
        self.sim.forward()
        roots = {each.name: each.root_body for each in self.model.mujoco_objects}
        places = np.array([self.sim.data.get_body_xpos(roots.get(name, name))[:2] for name in wide.distant])
        if not len(places):
            return True
        between = np.linalg.norm(places[:, None] - places[None], axis=-1)[np.triu_indices(len(places), 1)]
        return bool((between >= wide.apart).all())


def task_names() -> tuple[str, ...]:
    """Return the names of robosuite's tasks for one arm that can be made, those registered by users included."""
    return tuple(
        name
        for name, kind in REGISTERED_ENVS.items()
        if issubclass(kind, ManipulationEnv)
        and not issubclass(kind, TwoArmEnv)
        and not name.startswith(PREFIX)
        and name not in REFUSED
    )


def check_task(task: object) -> None:
    """Refuse what is no name of a task that can be made.

    Raises:
        UnknownName: robosuite has no such task for one arm.
        BadOption: the task cannot be made.
    """
    known = task_names()
    if isinstance(task, str) and task in REFUSED:
        raise BadOption("task", f"{task} cannot be made: {REFUSED[task]}; those that can: {', '.join(known)}")
    if task not in known:
        raise UnknownName("robosuite task for one arm", task, known)


def task_env(task: Any, robot: str, gripper: str, slots: int) -> Any:
    """Return robosuite's environment of a task.

    Args:
        task: robosuite's name of the task.
        robot: robosuite's name of the robot.
        gripper: robosuite's name of its gripper.
        slots: largest number of obstacles at once.

    Raises:
        UnknownName: robosuite has no such task for one arm.
        BadOption: the task cannot be made, or robosuite refuses the robot.
    """
    check_task(task)
    ROBOSUITE_DEFAULT_LOGGER.setLevel("ERROR")
    base: Any = REGISTERED_ENVS[task]
    kind: Any = type(base)(f"{PREFIX}{task}", (GuestTask, base), {"slots": slots})
    env = kind(
        robots=robot,
        gripper_types=gripper,
        controller_configs=robosuite.load_composite_controller_config(controller="BASIC"),
        initialization_noise=None,
        reward_shaping=True,
        use_camera_obs=False,
        has_renderer=False,
        has_offscreen_renderer=False,
        hard_reset=False,
        ignore_done=True,
        seed=0,
    )
    env.keep_nominal()
    return env


@contextmanager
def _widened(initializer: Any, wide: WideRange | None) -> Iterator[None]:
    """Let robosuite's samplers draw from wider ranges in the `with` block."""
    if wide is None:
        yield
        return
    found = [each for each in _samplers(initializer) if hasattr(each, "x_range")]
    before = [(each.x_range, each.y_range, each.ensure_valid_placement) for each in found]
    try:
        for each in found:
            if each.name in wide.objects:
                each.x_range, each.y_range = wide.objects[each.name]
            else:  # its objects are taken away afterwards, and may be where the others are
                each.ensure_valid_placement = False
        yield
    finally:
        for each, values in zip(found, before, strict=True):
            each.x_range, each.y_range, each.ensure_valid_placement = values


def _samplers(initializer: Any) -> Iterator[Any]:
    """Yield a sampler and those it consists of."""
    if initializer is not None:
        yield initializer
        for each in getattr(initializer, "samplers", {}).values():
            yield from _samplers(each)
