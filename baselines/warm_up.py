"""Warm-up of the shipped policies' compiled code before the first tick."""

from __future__ import annotations

from ..envs import TaskDescription
from ..envs.scene.body_clearance import tool_clearance
from ..planner import PosePath
from ..planner.geometry.shapes import pack
from ..planner.reactive.warm_up import FAR, warm_up


def warm_up_for(task: TaskDescription) -> None:
    """Compile, or load from the cache, the code that policies may need for a task; see `planner.reactive.warm_up`."""
    for arm, body in zip(task.arms, task.bodies, strict=True):
        warm_up(arm, body)
        tool_clearance(body.tool(arm), PosePath(arm.fk(0.5 * (arm.lower + arm.upper)).dq[None]).dqs, pack((FAR,)))
