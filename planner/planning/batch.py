"""Many plans on several cores."""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor

from ..arrays import checked_items
from ..ranges import check_count
from ..robot.arm import Arm
from ..robot.body import Body
from .plan import Plan, PlanRequest
from .planner import Planner
from .settings import PlanSettings


def plan_batch(
    requests: Sequence[PlanRequest], arm: Arm, body: Body, settings: PlanSettings | None = None, *, workers: int = 2
) -> list[Plan]:
    """Answer many requests on several cores; the plans equal those of answering one by one.

    Args:
        requests: the motions to plan.
        arm: the arm.
        body: its capsules, held object included.
        settings: of the planners; see `PlanSettings`.
        workers: number of threads: the compiled loops release the interpreter. Each takes the next request when it
            has finished its last, since a few hard ones take longer than all others together.

    Returns:
        The plans, in the order of the requests.

    Raises:
        WrongType: an item of the requests is none.
        BadOption: `workers` is not from 1 to 256.
    """
    check_count("workers", workers, "[1, 256]")
    requests = checked_items("requests", requests, PlanRequest)
    left = iter(enumerate(requests))  # taking the next request is one step of the interpreter

    def run(planner: Planner) -> dict[int, Plan]:
        return {k: planner.answer(request) for k, request in left}

    planners = [Planner(arm, body, settings) for _ in range(min(workers, len(requests)))]
    with ThreadPoolExecutor(workers) as pool:
        found = {k: plan for plans in pool.map(run, planners) for k, plan in plans.items()}
    return [found[k] for k in range(len(requests))]
