"""Pouring with the source in the hand, in front of the target."""

from __future__ import annotations

from typing import Any

import numpy as np

from ...planner import Pose
from ...planner.errors import BadOption
from ..core.declared_task import DeclaredTask, TaskEpisode, World
from ..core.goal_form import Agreement, GoalForm
from ..core.grasped_start import SQUEEZE, can_follow, holding_joints
from ..core.maker import SINGLE_MOTION, EnvironmentMaker
from ..core.placement_context import PlacementMotion
from ..core.reset_options import check_known, checked_joints
from ..judge.dense_reward import near
from ..simulation.state import State
from .facts import SOURCE, TARGET, TILT_POUR
from .geometry import BACK, TILTED, UP, pouring, tcp_from_glass
from .layout import GAP, RANGES, checked_stands, pour_layout
from .pour_env import VIEW, Pouring
from .rules import ENOUGH, SPILLED, PourProgress

OPTIONS = ("level", "stands", "joint_positions")
ASIDE = {"L0": 0.0, "L1": 0.03, "L2": 0.06}
"""Largest shift [m] of the held glass in x, y and z, by layout name."""
TURNS = np.deg2rad((0.0, 15.0, -15.0, 30.0, -30.0))
"""Turns [rad] of the direction of pouring from the nominal one; the first in which pouring is possible is used."""
TILTS = tuple(np.linspace(0.0, 1.0, 9))
"""Shares of the pouring tilt at which a posture must be reachable from the start."""
MAX_STARTS = 200


class TiltPouring(DeclaredTask):
    """Pouring with the source in the hand.

    Args:
        robot: name of the robot.
    """

    facts, name, goals, motions, view, too_short = TILT_POUR, TILT_POUR.name, 1, 2, VIEW, True

    def __init__(self, robot: str = "Panda"):
        pouring = self.pouring = Pouring(robot, pregrasped=True)
        self.robot, self.things, self.more = pouring.robot, pouring.things, pouring.more
        self.form = GoalForm((1.0, 1.0), _achieved, _desired, _agreement)

    def bind(self, world: World) -> None:
        """See `DeclaredTask`."""
        self.pouring.bind(world)

    def begin(self, world: World, options: dict[str, Any], layout: str, *, spacious: bool) -> TaskEpisode:
        """See `DeclaredTask`: stands as in pouring, the source in the hand in front of the target."""
        check_known(options, OPTIONS)
        pour = self.pouring
        given = checked_stands(options["stands"], pour.axis) if "stands" in options else None
        wanted = checked_joints(options["joint_positions"], world.arms) if "joint_positions" in options else None
        ranges, aside = RANGES[layout], ASIDE[layout]
        for _ in range(MAX_STARTS):
            tops = pour_layout(world.rng, ranges, pour.nominal, pour.axis, GAP) if given is None else given
            shift = world.rng.uniform(-aside, aside, 3)
            joints = self._before_target(world, tops, shift) if wanted is None else wanted
            if joints is not None and (wanted is not None or pour.is_clear(world, tops, joints)):
                glass = pour.glasses[SOURCE]
                held = (world.arms[0].fk(joints[0]) @ tcp_from_glass(glass)).vector
                return pour.episode(world, joints, tops, held=held, grip=2.0 * glass.radius - SQUEEZE)
        raise BadOption("stands", "the hand cannot be before the target, or not clear of the glasses, at the start")

    def _before_target(self, world: World, tops: np.ndarray, shift: np.ndarray) -> np.ndarray | None:
        """Return joints (1, dof) that hold the source in front of the target and can tilt it there, or None."""
        arm, glasses, ready = world.arms[0], self.pouring.glasses, self.pouring.ready[0]
        glass, rim = glasses[SOURCE], tops[TARGET] + [0.0, 0.0, glasses[TARGET].height]
        for turn in TURNS:
            yaw = self.pouring.yaw_at(world, rim, TARGET) + turn
            hand = Pose.from_position_quaternion(shift) @ pouring(glass, rim, yaw, 0.0, BACK, UP)
            q = holding_joints(arm, [hand], ready)
            if q is not None and can_follow(arm, q, [pouring(glass, rim, yaw, part * TILTED) for part in TILTS]):
                return q[None]
        return None

    def placement_motions(self, world: World, episode: TaskEpisode) -> list[PlacementMotion]:
        """See `DeclaredTask`."""
        return self.pouring.placement_motions(world, episode)

    def observed(self, episode: TaskEpisode) -> dict[str, np.ndarray]:
        """See `DeclaredTask`."""
        return self.pouring.observed(episode)


def _achieved(episode: TaskEpisode, state: State) -> np.ndarray:
    """Return (2,) the shares of the beads in the target and outside both glasses."""
    assert isinstance(episode.progress, PourProgress)
    return episode.progress.fractions[1:].copy()


def _desired(episode: TaskEpisode) -> np.ndarray:
    """Return (2,) all beads in the target and none outside."""
    return np.array([1.0, 0.0])


def _agreement(achieved: np.ndarray, desired: np.ndarray) -> Agreement:
    """Return how well shares of missing and of spilled beads agree; more than desired costs nothing."""
    missing = np.maximum(desired[..., 0] - achieved[..., 0], 0.0)
    spilled = np.maximum(achieved[..., 1] - desired[..., 1], 0.0)
    reached = (missing <= 1.0 - ENOUGH + 1e-9) & (spilled <= SPILLED + 1e-9)
    return Agreement(near(0.2 * (missing + spilled)), reached)


tilt_pour_env = EnvironmentMaker(TiltPouring, **SINGLE_MOTION)
