"""The tool frame of a robot whose user names none."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from ...planner.models.urdf_model import UrdfModel


def end_of_chain(parents: Sequence[int], joints: Sequence[int]) -> int:
    """Return the end of the longest chain of a tree: where two branches are equally long, like fingers, it ends.

    Args:
        parents: index of each node's parent, lower than its own; the parent of node 0 does not count.
        joints: number of joints that move each node against its parent.
    """
    height = list(joints)
    children: list[list[int]] = [[] for _ in parents]
    for node in range(len(parents) - 1, 0, -1):
        children[parents[node]].append(node)
        height[parents[node]] = max(height[parents[node]], joints[parents[node]] + height[node])
    node = 0
    while children[node]:
        longest = max(height[child] for child in children[node])
        found = [child for child in children[node] if height[child] == longest]
        if len(found) > 1 or longest == 0:
            break
        node = found[0]
    return node


def end_that_moves(parents: Sequence[int], joints: Sequence[int]) -> int | None:
    """Return the end of the longest chain; None if no joint moves it, since chains of equal length begin at once.

    Args:
        parents: see `end_of_chain`.
        joints: see `end_of_chain`.
    """
    node = end = end_of_chain(parents, joints)
    while node != 0 and joints[node] == 0:
        node = parents[node]
    return end if joints[node] else None


def tool_of_urdf(model: UrdfModel) -> str | None:
    """Return the link at the end of a URDF's longest chain; None if there is no single one."""
    parents = [int(parent) for parent in model.pinocchio.parents]
    end = end_that_moves(parents, [0, *[1] * (len(parents) - 1)])
    return None if end is None else next(name for name, joint in model.links() if joint == end)


def tool_of_mujoco(model: Any) -> str | None:
    """Return the body at the end of a compiled model's longest chain, "" without a name; None: no single one."""
    joints = [int(count) for count in model.body_jntnum]
    end = end_that_moves([int(parent) for parent in model.body_parentid], joints)
    return None if end is None else model.body(end).name
