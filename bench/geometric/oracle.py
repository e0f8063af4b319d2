"""Oracle of what is possible: whether any motion keeps a constraint, of the arm or of a free tool, by long searches.

Possible is what a search finds. Impossible is only what a grid shows. At places along the guided stretch it holds the
path's own pose and all that are off it by the bound in position, in rotation or in both, in each of 26 directions: 729
in all. It shows that at some place the tool collides at all of them, or the arm has a clear posture at none; or that no
chain of clear ones, each next to the one before, leads along it. The rest is undecided, and counts as possible.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from scipy.ndimage import binary_dilation, binary_propagation

from ...planner import Arm, Body, Obstacle, PlanSettings, Pose, PosePath, escape_path, final_path, imitated_path
from ...planner.collision.edge_certificates import tool_arrays, tool_slack
from ...planner.constraints.request_constraint import fitted
from ...planner.constraints.violation import violation_of
from ...planner.control.arm_arrays import arm_arrays
from ...planner.control.inverse_kinematics import inverse_kinematics
from ...planner.geometry.shapes import pack
from ...planner.imitation.constraint import Constraint
from ...planner.imitation.segmentation import key_poses
from ...planner.planning.constrained_search import ConstrainedSearch
from ...planner.planning.joint_space_motion import SearchFailure
from ...planner.planning.planning_scene import PlanningScene
from ...planner.resumable import finished
from ...planner.search.joint_space_rrt import sample_ranges

POSSIBLE, IMPOSSIBLE, UNDECIDED = "possible", "impossible", "undecided"
SPACING = 0.02
"""Path length [m] between the places of the grid."""
STEPS = np.array(sorted(itertools.product((-1.0, 0.0, 1.0), repeat=6), key=lambda each: sum(map(abs, each))))
"""(729, 6) steps of the grid, in position and in rotation, the smallest first."""
FEW = 73
"""Number of the smallest deviations whose postures are chained: those in at most two coordinates."""
CHAINED = 0.6
"""Largest difference of a joint [rad or m] between two neighbors of a chain of postures."""
STARTS = 12
"""Starts of the inverse kinematics at each pose of the grid, beside the last posture that was found."""
LOOKS = 60
"""Starts at the path's own pose, before the grid is asked."""
TRIES = 4
"""Searches of the arm, each with other random numbers, and twice the postures and samples of the planner's."""
TREES = (0.02, 0.014, 0.007, 0.002)
"""Distances to obstacles [m] that the trees of the free tool keep."""


class Verdict(NamedTuple):
    """The answer to whether a constraint can be kept.

    Attributes:
        answer: POSSIBLE, IMPOSSIBLE or UNDECIDED.
        evidence: what decided, in words.
    """

    answer: str
    evidence: str


class Question(NamedTuple):
    """A motion that should keep a constraint.

    Attributes:
        arm: the arm.
        body: its capsules, held object included.
        obstacles: around it.
        demonstrated: path of the tcp.
        constraint: of that path.
        joints: (dof,) at the start.
        goal: of the tcp.
    """

    arm: Arm
    body: Body
    obstacles: Sequence[Obstacle]
    demonstrated: PosePath
    constraint: Constraint
    joints: np.ndarray
    goal: Pose

    @property
    def imitated(self) -> PosePath:
        """The demonstrated path at the goal."""
        return imitated_path(self.demonstrated, self.goal)

    @property
    def fitted(self) -> Constraint:
        """The constraint at this start and goal."""
        return fitted(self.constraint, self.imitated, self.arm.fk(self.joints))

    @property
    def places(self) -> PosePath:
        """Poses at even steps of the guided stretch; the goal alone if there is none."""
        guided = self.imitated[self.constraint.last_carried :]
        return (
            key_poses(guided, max(2, int(np.ceil(guided.lengths()[-1] / SPACING)) + 1)) if len(guided) > 1 else guided
        )


def deviations(constraint: Constraint, pose: Pose) -> Iterator[Pose]:
    """Yield a pose at all deviations of the grid, itself first.

    Args:
        constraint: its bounds.
        pose: on the path.
    """
    for step in STEPS:
        shift, turn = (
            bound * part / max(float(np.linalg.norm(part)), 1.0)
            for bound, part in ((constraint.position_bound, step[:3]), (constraint.rotation_bound, step[3:]))
        )
        half = 0.5 * float(np.linalg.norm(turn))
        axis = turn / max(2.0 * half, 1e-12)
        at = Pose.from_position_quaternion(constraint.point, [1.0, 0.0, 0.0, 0.0])
        turned = Pose.from_position_quaternion(np.zeros(3), [np.cos(half), *(np.sin(half) * axis)])
        yield Pose.from_position_quaternion(shift, [1.0, 0.0, 0.0, 0.0]) @ pose @ at @ turned @ at.inverse()


def tool_verdict(question: Question) -> Verdict:
    """Return whether a free tool can keep the constraint."""
    tool = question.body.tool(question.arm)
    work = tool_arrays(tool, pack(question.obstacles), margin=0.0)
    for k, place in enumerate(question.places):
        if not any(tool_slack(work, _tuple(pose), 0.1) >= 0.0 for pose in deviations(question.constraint, place)):
            return Verdict(
                IMPOSSIBLE, f"the tool collides at place {k} of {len(question.places)} of the guided stretch"
            )
    start, imitated, constraint = question.arm.fk(question.joints), question.imitated, question.fitted
    path = final_path(start, imitated, constraint.last_carried)
    left = constraint.count - constraint.guided
    repet = PlanSettings().repet
    for seed, distance in itertools.product(range(3), TREES):
        settings = replace(repet, distance=distance, retries=4 + 4 * seed)
        found = escape_path(
            path, tool, question.obstacles, settings, seed=seed, guided=len(path) - left if left else None
        )
        if found.found and violation_of(constraint, imitated, found.path).kept:
            return Verdict(POSSIBLE, "an escape tree")
    masks = [_clear_deviations(question, work, place) for place in question.places]
    if not _is_connected(masks):
        return Verdict(IMPOSSIBLE, "no chain of clear deviations leads along the guided stretch")
    return Verdict(UNDECIDED, "a chain of clear deviations leads along the guided stretch, and no tree leads to it")


def _clear_deviations(question: Question, work: np.ndarray, place: Pose) -> np.ndarray:
    """Return which deviations (3, 3, 3, 3, 3, 3) of the grid are clear at a place."""
    clear = np.zeros((3,) * 6, dtype=bool)
    for step, pose in zip(STEPS, deviations(question.constraint, place), strict=True):
        clear[tuple(step.astype(int) + 1)] = tool_slack(work, _tuple(pose), 0.1) >= 0.0
    return clear


def _is_connected(masks: list[np.ndarray]) -> bool:
    """True if clear deviations lead to the path's own pose at the end, each at most one step from the one before.

    Steps are not checked for contacts, which errs to the side of the possible.
    """
    near = np.ones((3,) * 6, dtype=bool)
    reached = masks[0]
    for clear in masks[1:]:
        reached = binary_propagation(binary_dilation(reached, near) & clear, near, clear)
    return bool(reached[(1,) * 6])


def _tuple(pose: Pose) -> tuple[float, ...]:
    return tuple(float(value) for value in pose.dq)


def arm_verdict(question: Question, tries: int = TRIES) -> Verdict:
    """Return whether the arm can keep the constraint.

    Args:
        question: the motion.
        tries: number of searches.
    """
    settings = PlanSettings()
    scene = PlanningScene.of(question.arm, question.body, tuple(question.obstacles), settings)
    for k, place in enumerate(question.places):
        if not _has_posture(question, scene, place):
            return Verdict(IMPOSSIBLE, f"no posture at place {k} of {len(question.places)} of the guided stretch")
    assert settings.search is not None
    search = replace(settings.search, seeds=120, iterations=6000, nodes=6000)
    settings = replace(settings, search=search)
    work = arm_arrays(question.arm, settings.motion.controller.packed(), settings.motion.pursuit.packed())
    reason = ""
    for seed in range(tries):
        found = finished(
            ConstrainedSearch(
                question.arm, scene, work, question.demonstrated, question.goal, question.joints, question.fitted,
                settings, None, seed,
            ).run()
        )  # fmt: skip
        if not isinstance(found, SearchFailure):
            poses = PosePath(np.array([question.arm.fk(q).dq for q in found.joints]))
            if violation_of(question.fitted, question.imitated, poses).kept:
                return Verdict(POSSIBLE, f"search {seed}")
        else:
            reason = f"{found.reason}: {found.detail}"
    if not _is_chained(question, scene):
        return Verdict(IMPOSSIBLE, "no chain of postures leads along the guided stretch")
    return Verdict(UNDECIDED, reason)


def _is_chained(question: Question, scene: PlanningScene) -> bool:
    """True if postures lead along the guided stretch, each near one before: of each place, at its small deviations.

    Lines between postures are not checked, which errs to the side of the possible.
    """
    places, rng = question.places, np.random.default_rng(1)
    reached = _postures_at(question, scene, places[-1:][0], rng, np.empty((0, question.arm.dof)), 1)
    for place in list(places)[-2::-1]:
        every = _postures_at(question, scene, place, rng, reached, FEW)
        fresh, todo = np.zeros(len(every), dtype=bool), reached
        while len(todo) and len(every):
            near = (np.abs(every[:, None] - todo[None]).max(axis=2) <= CHAINED).any(axis=1) & ~fresh
            fresh, todo = fresh | near, every[near]
        reached = every[fresh]
        if not len(reached):
            return False
    return True


def _postures_at(
    question: Question, scene: PlanningScene, place: Pose, rng: np.random.Generator, before: np.ndarray, count: int
) -> np.ndarray:
    """Return clear postures (n, dof) at a place and at its smallest deviations."""
    low, high = sample_ranges(question.arm.lower, question.arm.upper, question.joints)
    found = []
    for k, pose in enumerate(itertools.islice(deviations(question.constraint, place), count)):
        if scene.tool_slack(pose) < 0.0:
            continue
        guesses = [rng.uniform(low, high) for _ in range(10 * STARTS if k == 0 else STARTS)]
        if len(before):
            guesses += list(before[rng.integers(len(before), size=STARTS)])
        for guess in guesses:
            q = inverse_kinematics(question.arm, pose, guess, iterations=100)
            if q is not None and scene.slack(q) >= 0.0:
                found.append(q)
    return np.array(found).reshape(-1, question.arm.dof)


def _has_posture(question: Question, scene: PlanningScene, place: Pose) -> bool:
    """True if the arm has a clear posture at a place, or at a deviation of the grid from it."""
    rng = np.random.default_rng(0)
    low, high = sample_ranges(question.arm.lower, question.arm.upper, question.joints)
    for k, pose in enumerate(deviations(question.constraint, place)):
        if k and scene.tool_slack(pose) < 0.0:
            continue
        for start in range(LOOKS if k == 0 else STARTS):
            guess = question.joints if start == 0 else rng.uniform(low, high)
            q = inverse_kinematics(question.arm, pose, guess, iterations=100)
            if q is not None and scene.slack(q) >= 0.0:
                return True
    return False
