"""Demonstrations of any length, planned and judged; run in a process of its own, which may crash.

    python tests/planner/long_paths.py [poses ...]

A line for each: what was planned, whether its judge agrees, the seconds, and the process's largest memory so far.
"""

from __future__ import annotations

import resource
import sys

import numpy as np
from memory_cases import ARM, BALL, BODY, FAR, GOAL, HOME, SETTINGS, START

from onedemo import planner as face
from onedemo.planner.geometry import dualquat as dq

LONGEST = SETTINGS.repet.longest


def shown(count: int, tremor: float = 0.0) -> face.PosePath:
    """The straight way to the goal in a number of poses, with a tremor [m, rad] of the hand."""
    poses = dq.sclerp(START.dq, GOAL.dq, np.linspace(0.0, 1.0, count))
    noise = tremor * np.random.default_rng(0).standard_normal((count, 6))
    noise[[0, -1]] = 0.0
    return face.PosePath(dq.mul(poses, dq.dq_from_twist(noise)))


def report(what: str, plan: face.Plan) -> None:
    sound = face.certify(plan.log()).ok and len(plan.joints) > 1
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    words = f"{plan.how or plan.why} {'sound' if plan.success and sound else 'NOT SOUND'}"
    took = f"planned in {plan.seconds:.2f} s, {memory:.0f} MB"
    print(f"{what}: {words}, {len(plan.imitated_poses)} poses within {plan.reduction:.2g} m, {took}", flush=True)


def follow(path: face.PosePath) -> str:
    """The last state of a reactive planner along a path past the ball."""
    follower, q = face.ReactivePlanner(ARM, BODY, face.ReactiveSettings(plan=SETTINGS)), HOME.copy()
    follower.see([BALL])
    follower.go(path)
    for _ in range(1500):
        command = follower.step(q)
        if command.state in ("done", "failed"):
            break
        q = q + 0.02 * command.velocity
    return command.state


def main() -> None:
    planner = face.Planner(ARM, BODY, SETTINGS)
    for count in map(int, sys.argv[1:] or (LONGEST - 10, LONGEST, LONGEST + 1, 5000, 20_000)):
        for obstacles in ((FAR,), (BALL,)):
            plan = planner.plan(shown(count, 1e-4), HOME, GOAL, obstacles)
            report(f"{count} poses, {'a ball in the way' if BALL in obstacles else 'free'}", plan)
            assert len(plan.request.demonstrated) == count
    if not sys.argv[1:]:
        report("leaving by 6000 poses", planner.plan(shown(5), HOME, GOAL, leaving=shown(6000)))
        lead = planner.plan(shown(LONGEST), HOME, GOAL, [BALL], leaving=shown(LONGEST), seed=3)
        report("leaving and demonstration as long as may be", lead)
        print(f"a reactive planner along 5000 poses: {follow(shown(5000))}", flush=True)
    print("ended", flush=True)


if __name__ == "__main__":
    main()
