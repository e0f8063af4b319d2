"""Arms for tests."""

from __future__ import annotations

import json
from functools import cache
from pathlib import Path

import numpy as np
from helpers.strategies import random_dq

from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import Body

MODELS = Path(__file__).parent.parent / "models"
"""Models of the tests' own: the planner is tested where no simulator is installed."""


def panda_urdf() -> Path:
    """The Panda, with cylinders in place of its meshes."""
    return MODELS / "panda.urdf"


@cache
def table_panda() -> tuple[Arm, Body, np.ndarray]:
    """The Panda as it stands at the tasks' table: arm, capsules, usual joints."""
    table = json.loads((MODELS / "panda_at_table.json").read_text(encoding="utf-8"))
    arm = Arm(
        table["name"],
        tuple(table["joint_names"]),
        np.array(table["chain"]),
        np.array(table["lower"]),
        np.array(table["upper"]),
        np.array(table["velocity_limits"]),
    )
    return arm, Body(np.array(table["capsules"]), tuple(table["parts"])), np.array(table["home"])


@cache
def panda() -> Arm:
    return Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8")


READY = np.array([0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.78])
"""The Panda in front of itself, far from limits and singularities."""


def free_panda() -> Arm:
    """A Panda without limits to speak of: for what holds only while none is active."""
    arm = panda()
    wide = np.full(7, 50.0)
    return Arm("free panda", arm.joint_names, arm.chain, -wide, wide, 1e6 * np.ones(7))


def random_arm(seed: int, dof: int = 7, prismatic: float = 0.2) -> Arm:
    rng = np.random.default_rng(seed)
    fixed = random_dq(rng, dof + 1)
    kinds = (rng.uniform(size=dof + 1) < prismatic).astype(float)
    chain = np.column_stack([fixed[:, :4], rng.uniform(-0.4, 0.4, (dof + 1, 3)), kinds])
    names = tuple(f"joint{k}" for k in range(dof))
    return Arm("random", names, chain, np.full(dof, -3.0), np.full(dof, 3.0), np.full(dof, 2.0))


def joints(arm: Arm, rng: np.random.Generator) -> np.ndarray:
    return rng.uniform(arm.lower, arm.upper)


def joints_at(arm: Arm, x: np.ndarray, q: np.ndarray) -> np.ndarray:
    """Joints near q whose tool is at x (8,) to the last digits, by Newton's method."""
    for _ in range(20):
        here, body = arm.fk_jacobian(q)
        twist = dq.twist_from_dq(dq.mul(dq.conj(here), x))
        if np.abs(twist).max() < 1e-14:
            break
        q = q + np.linalg.pinv(body) @ twist
    assert np.abs(twist).max() < 1e-12
    return q
