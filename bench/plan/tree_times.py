"""Cost of escape trees: the trees of shipped scenes, grown repeatedly.

Times are processor times, so that other load on the machine matters little.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from ...planner.collision.edge_certificates import tool_arrays
from ...planner.escape import escape_tree
from ...planner.escape.repet import EscapeTree, RepetSettings, escape_path
from ...planner.escape.tree_arrays import NODE, OPTION
from ...planner.geometry import screw
from ...planner.geometry.pose import PosePath
from ...planner.geometry.shapes import pack
from ...planner.imitation.tsia import final_path, guide_index, imitated_path
from ...planner.jit import kernel
from ...planner.safety.robot_checks import contact_masks
from .scene_plan import ScenePlan

LOOPS = 100
"""Planes per sample, expanded in a compiled loop."""
CELLS = 64
"""Size of the cell table and of the tree in that loop."""


@dataclass(frozen=True, slots=True)
class TreeTimes:
    """Times of a scene's first tree [ms], as mean and standard deviation over samples.

    Attributes:
        scene: name of the scene.
        planes: number of planes.
        levels: largest number of planes between a leaf and the root.
        plane_ms: a plane at the root with its eight children and all edges proven, in a compiled loop.
        detour_ms: a whole detour called from Python: finding the blocked stretch, the tree, the return to the path.
        detour_level_ms: `detour_ms` divided by the number of levels.
        plan_ms: elapsed time of the arm's whole plan, measured once.
    """

    scene: str
    planes: int
    levels: int
    plane_ms: tuple[float, float]
    detour_ms: tuple[float, float]
    detour_level_ms: tuple[float, float]
    plan_ms: float


@kernel
def expand_loop(g, tree, goal, cells, options, state, repeats):
    """Expand the root of a tree toward a goal repeatedly; see `escape_tree.expand`.

    Args:
        g: work array of the tool and the obstacles.
        tree: (n, NODE.width) nodes, the root first.
        goal: (1, 8) dual quaternion.
        cells: (m,) cell table, cleared before every expansion.
        options: packed `RepetSettings`.
        state: (1,) state of the random generator.
        repeats: number of expansions.
    """
    towards = screw.load8(goal, 0)
    for _ in range(repeats):
        for k in range(len(cells)):
            cells[k] = -1.0
        escape_tree.expand(g, tree, 0, 1, towards, cells, options, options[OPTION.step], state)
    return tree[1, 0]


def timed_tree(planned: ScenePlan, repeats: int) -> TreeTimes:
    """Measure the first tree of a scene.

    Args:
        planned: the scene and its plan.
        repeats: number of samples.

    Raises:
        ValueError: no obstacle blocks the path, so that there is no tree.
    """
    scene = planned.scene
    settings = replace(planned.settings.repet, rounds=1, retries=0)
    path, tool = _nominal(planned), planned.body.tool(planned.arm)
    names = planned.body.at_tool(planned.arm).names
    masks = contact_masks(names, scene.obstacles, [pair for pair in scene.allowed if pair[0] in names])
    tree = escape_path(path, tool, scene.obstacles, settings, masks=masks).tree
    if tree is None:
        raise ValueError(f"{scene.name}: no detour is needed")
    levels = levels_of(tree)
    detour = _milliseconds(lambda: escape_path(path, tool, scene.obstacles, settings, masks=masks), repeats)
    g = tool_arrays(tool, pack(scene.obstacles), masks=masks, margin=settings.distance)
    return TreeTimes(
        scene=scene.name,
        planes=len(tree.planes),
        levels=levels,
        plane_ms=_plane_ms(g, tree, path, settings, repeats),
        detour_ms=detour,
        detour_level_ms=(detour[0] / levels, detour[1] / levels),
        plan_ms=1e3 * planned.plan.seconds,
    )


def _plane_ms(
    g: np.ndarray, tree: EscapeTree, path: PosePath, settings: RepetSettings, repeats: int
) -> tuple[float, float]:
    options, rows = settings.packed(), np.zeros((CELLS, NODE.width))
    options[OPTION.largest_margin], options[OPTION.random] = settings.distance, 0.0  # as a first tree has it
    rows[0, :8] = tree.poses[0]
    cells, state, goal = np.full(CELLS, -1.0), np.ones(1), np.ascontiguousarray(path.dqs[-1:])
    mean, deviation = _milliseconds(lambda: expand_loop(g, rows, goal, cells, options, state, LOOPS), repeats)
    return mean / LOOPS, deviation / LOOPS


def _nominal(planned: ScenePlan) -> PosePath:
    """Return the blocked final path."""
    imitated = imitated_path(planned.scene.demonstrated, planned.scene.goal)
    guide = guide_index(imitated, planned.settings.motion.guide) if len(imitated) > 1 else 0
    return final_path(planned.arm.fk(planned.start), imitated, guide)


def _milliseconds(function: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Return mean and standard deviation of a call's processor time [ms]; a first call for loading is not counted."""
    function()
    samples = []
    for _ in range(repeats):
        start = time.thread_time()
        function()
        samples.append(1e3 * (time.thread_time() - start))
    return float(np.mean(samples)), float(np.std(samples))


def levels_of(tree: EscapeTree) -> int:
    """Return the largest number of planes between a node and the root."""
    depth = np.zeros(len(tree.parents), dtype=int)
    for row, parent in enumerate(tree.parents):
        depth[row] = 0 if parent < 0 else depth[parent] + 1
    return int(depth.max())
