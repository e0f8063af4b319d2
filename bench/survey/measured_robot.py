"""The measurement of one robot: loaded, covered, its self-contact, its plans, and what the judges say of them."""

from __future__ import annotations

import time
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from ...planner import Planner, PosePath, certify
from ...planner.collision.self_collision import body_pairs
from ..robot.load_robot import LoadedRobot, kind_of, read_robot
from ..robot.mesh_judge import MeshJudge
from ..robot.robot_summary import postures_of, volumes_of
from .random_problems import RandomProblem, random_problems
from .robot_list import ListedRobot
from .true_contacts import SelfContact, self_contact, true_robot

Row = dict[str, Any]
KINDS = ("direct", "escape", "joint search")
"""Kinds of plans, see `Plan.how`."""
FREE, AMONG = "free", "among obstacles"


class Counts(NamedTuple):
    """Numbers of random draws for each robot.

    Attributes:
        postures: random postures for its self-contact.
        problems: problems of each kind.
    """

    postures: int
    problems: int


def measured(robot: ListedRobot, counts: Counts) -> Row:
    """Measure a robot; the random numbers depend on its name alone.

    Args:
        robot: its package is installed.
        counts: how much is measured.

    Raises:
        BadModel: its file cannot be used.
        PlanFailed: none of its random postures is clear.
    """
    request, rngs = robot.request, [np.random.default_rng([k, *robot.entry.name.encode()]) for k in range(3)]
    begun = time.perf_counter()
    file = read_robot(request)
    load_seconds, cpu = time.perf_counter() - begun, time.process_time()
    loaded = file.covered(anew=True)
    row = {"load_s": load_seconds, "fit_cpu_s": time.process_time() - cpu, **_body_row(loaded)}
    truth = true_robot(loaded, request)
    postures = rngs[0].uniform(*postures_of(loaded.arm), (counts.postures, loaded.arm.dof))
    contact = self_contact(loaded, truth, postures)
    judge = truth.judge([(one, other) for one, other in contact.resting])
    plans = {
        kind: plans_row(loaded, judge, random_problems(loaded, rng, counts.problems, among=kind == AMONG))
        for kind, rng in ((FREE, rngs[1]), (AMONG, rngs[2]))
    }
    return {"format": _format(kind_of(request.file)), **row, "contact": contact._asdict(), "plans": plans}


def _format(kind: str) -> str:
    return "MJCF" if kind == "mujoco" else "URDF"


def _body_row(robot: LoadedRobot) -> Row:
    arm, body = robot.arm, robot.body
    volumes = [each for each in volumes_of(robot) if not np.isnan(each.geometry)]
    joints = ["slides" if kind else "turns" for kind in arm.chain[:-1, 7]]
    return {
        "dof": arm.dof,
        "sliding": joints.count("slides"),
        "endless": int(np.sum(~np.isfinite(arm.upper - arm.lower))),
        "tool": robot.tool,
        "capsules": len(body),
        "pieces": len({id(hull) for hull in body.hulls}),
        "parts": len(set(body.names)),
        "pairs": len(body_pairs(arm, body, 0.0)),
        "capsules_l": 1e3 * sum(each.volume for each in volumes),
        "meshes_l": 1e3 * sum(each.geometry for each in volumes),
    }


def plans_row(robot: LoadedRobot, judge: MeshJudge, problems: Sequence[RandomProblem]) -> Row:
    """Plan for problems and judge the plans.

    The demonstration is the screw motion of the tool from start to goal.

    Args:
        robot: the robot.
        judge: of the meshes.
        problems: to be solved.
    """
    planner = Planner(robot.arm, robot.body)
    row: Row = {"problems": len(problems), "cpu_ms": [], "failures": [], "unsound": [], "contacts": []}
    row |= {kind: 0 for kind in KINDS}
    for k, problem in enumerate(problems):
        tool = [robot.arm.fk(q) for q in (problem.start, problem.goal)]
        shown = PosePath.from_vectors(np.array([pose.vector for pose in tool]))
        begun = time.process_time()
        plan = planner.plan(shown, problem.start, tool[1], problem.obstacles)
        row["cpu_ms"].append(1e3 * (time.process_time() - begun))
        if not plan.success:
            row["failures"].append(f"{k}: {plan.why}")
            continue
        row[plan.how] += 1
        certificate = certify(plan.log())
        if not certificate.ok:
            row["unsound"].append(f"{k}: {'; '.join(certificate.reasons)}")
        contact = judge.first_contact(plan.joints, problem.obstacles)
        if contact is not None:
            row["contacts"].append(f"{k}: {contact.link} touches {contact.other} at sample {contact.sample}")
    row["solved"] = len(problems) - len(row["failures"])
    return row


def contact_of(row: Row) -> SelfContact:
    """Return the self-contact of a row."""
    return SelfContact(**row["contact"])
