"""Figure of a plan in the paper's colors: demonstration blue, final path magenta, collision-free path cyan."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from ...planner import Body, Certificate, Pose, final_path, guide_index, imitated_path
from ...planner.imitation.segmentation import resampled
from ...planner.robot.body import BODY
from ...planner.robot.joint_frames import joint_frames
from ..drawing.convex_view import ConvexSolid, DrawingView, back_to_front, ball_along, best_view, hidden_by, solid_of
from ..drawing.solids import arm_patch, floor_corners, paint_arm, paint_floor, paint_shells, paint_solid, scale_ends
from .escape_tree import KEPT, PLANE, REJECTED, paint_tree
from .scene_plan import ScenePlan

DEMONSTRATED, FINAL, FREE = "#1f4fd8", "#d81fb4", "#00a9c7"
SHADOW = "#bdb6a8"
FRAME_COLORS = ("#d43c3c", "#3aa03a", "#3a5fd4")
GROUND = ("table", "floor", "ground")
"""Names of boxes that are drawn as the floor."""
HIDDEN = 0.34
"""Opacity of lines behind a solid."""
TRIAD, LABEL, TOP = 0.055, 0.035, 0.06
"""Length of a triad's axes, distance of its label, and space above the content [m]."""
DPI = 144
OPTIONS: dict[str, dict[str, Any]] = {
    ".png": {"pil_kwargs": {"optimize": True}},
    ".pdf": {"metadata": {"CreationDate": None}},
    ".svg": {"metadata": {"Date": None}},
}
"""Options of `savefig` for small, reproducible files."""
BORDER = np.array([0.06, 0.06, 0.0])
"""Border [m] of the floor for the numbers on it."""
SIDES = np.array([[1.0, 0.0, 0.0], [-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
"""Directions from the center of the floor to its sides."""
WIDTH, ABOVE, BELOW = 9.0, 0.4, 0.72
"""Width of the figure, and heights reserved for title and legend [inch]."""


class Content(NamedTuple):
    """Content of the figure, in the world.

    Attributes:
        demonstrated: (n, 3) demonstrated path [m], where it was recorded.
        final: (n, 3) final path [m]: one screw to the guiding pose, then the imitated path.
        executed: (n, 3) path of the tcp [m]; empty if no plan was found.
        frames: start and goal of the tcp.
        solids: obstacles, without the floor.
        shelled: per solid, whether it has the general margin, so that its shell is drawn.
        arms: capsules of the arm at the start and, if a plan was found, at its end.
        floor: height of the floor [m].
        table: (4, 3) corners of the floor [m]; None if the scene has none.
    """

    demonstrated: np.ndarray
    final: np.ndarray
    executed: np.ndarray
    frames: tuple[Pose, Pose]
    solids: list[ConvexSolid]
    shelled: list[bool]
    arms: list[list[ConvexSolid]]
    floor: float
    table: np.ndarray | None


def draw_plan(
    planned: ScenePlan, certificate: Certificate | None, files: Sequence[Path], *, every_plane: bool = False
) -> DrawingView:
    """Draw a plan into every file.

    Args:
        planned: the scene and its plan.
        certificate: verdict of the judge, or None.
        files: pictures to write.
        every_plane: draw every plane of the tree, instead of those along the branch taken.

    Returns:
        The view chosen.
    """
    import matplotlib

    matplotlib.use("Agg")
    import matplotlib.pyplot as plt

    content = content_of(planned)
    shown = content.executed if len(content.executed) else content.final
    ghosts = [capsule for arm in content.arms for capsule in arm]
    view = best_view(_thinned(shown), _thinned(content.final), content.solids, ghosts)
    low, high = window_of(content, view)
    height = min(max(WIDTH * (high - low)[1] / (high - low)[0], 3.6), 6.6)
    with plt.rc_context({"font.family": "DejaVu Sans", "svg.hashsalt": "onedemo"}):
        figure = plt.figure(figsize=(WIDTH, height + BELOW + ABOVE))
        whole = height + BELOW + ABOVE
        axes = figure.add_axes((0.01, BELOW / whole, 0.98, height / whole))
        low, high = _stretched(low, high, 0.98 * WIDTH / height)
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.axis("off")
        _paint(axes, planned, content, view, every_plane)
        _legend(figure, planned, content)
        figure.text(
            0.5,
            1.0 - 0.22 / whole,
            _title(planned, certificate),
            fontsize=12,
            ha="center",
            va="center",
            parse_math=False,
        )
        for file in files:
            figure.savefig(file, dpi=DPI, facecolor="white", **OPTIONS.get(file.suffix.lower(), {}))
        plt.close(figure)
    return view


def content_of(planned: ScenePlan) -> Content:
    """Return the content of a plan's figure."""
    plan, scene, arm = planned.plan, planned.scene, planned.arm
    imitated = imitated_path(scene.demonstrated, scene.goal)
    start = arm.fk(planned.start)
    guide = guide_index(imitated, planned.settings.motion.guide) if len(imitated) > 1 else 0
    final = final_path(start, imitated, guide)
    executed = np.array([arm.fk(q).position for q in plan.joints]) if plan.success else np.zeros((0, 3))
    ground = [o for o in scene.obstacles if o.name in GROUND and hasattr(o.shape, "size")]
    others = [o for o in scene.obstacles if o not in ground]
    solids = [solid_of(o.shape, o.pose) for o in others]
    table = None
    if ground:
        top = solid_of(ground[0].shape, ground[0].pose)
        table = max(top.facets, key=lambda facet: facet.normal[2]).corners
    ends = [planned.start, *([plan.joints[-1]] if plan.success else [])]
    points = np.vstack([scene.demonstrated.positions, final.positions, *[s.core - [0, 0, s.radius] for s in solids]])
    floor = float(table[:, 2].max()) if table is not None else float(points[:, 2].min()) - 0.05
    return Content(
        resampled(scene.demonstrated, 0.005).positions,
        resampled(final, 0.005).positions,
        executed,
        (start, scene.goal),
        solids,
        [o.margin is None for o in others],
        [capsules_of(planned, q) for q in ends],
        floor,
        table,
    )


def capsules_of(planned: ScenePlan, q: np.ndarray) -> list[ConvexSolid]:
    """Return the arm's capsules in the world.

    Args:
        planned: the scene and its plan.
        q: (dof,) joints [rad].
    """
    poses = [Pose.identity(), *joint_frames(planned.arm, q)]
    out = []
    body: Body = planned.body
    for row in body.rows:
        pose = poses[int(row[BODY.frame]) + 1]
        a, b = (pose.rotation @ row[first : first + 3] + pose.position for first in (BODY.a, BODY.b))
        out.append(ball_along(a, b, float(row[BODY.radius])))
    return out


def _thinned(points: np.ndarray) -> np.ndarray:
    return points[np.unique(np.linspace(0, len(points) - 1, 60).astype(int))]


def room_of(content: Content) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the drawn volume: paths and obstacles, down to the floor.

    Returns:
        Lowest and highest corner (3,) [m].
    """
    solids = [s.core + sign * s.radius for s in content.solids for sign in (-1.0, 1.0)]
    points = np.vstack([content.demonstrated, content.final, content.executed, *solids])
    low, high = points.min(axis=0) - 0.1, points.max(axis=0) + 0.1
    if content.table is not None:
        # the floor stops at the table's edges, and does not extend beyond the content
        edges = content.table.min(axis=0), content.table.max(axis=0)
        low[:2], high[:2] = np.maximum(low, edges[0])[:2], np.minimum(high, edges[1])[:2]
        low[:2], high[:2] = np.minimum(low, high - 0.2)[:2], np.maximum(high, low + 0.2)[:2]
    low[2] = content.floor
    return low, high


def window_of(content: Content, view: DrawingView) -> tuple[np.ndarray, np.ndarray]:
    """Return the bounds of the visible window: paths, frames, obstacles and the hand, with a border.

    Args:
        content: content of the figure.
        view: the view.

    Returns:
        Lowest and highest corner (2,) [m] in the picture plane.
    """
    low, high = room_of(content)
    corners = floor_corners(low - BORDER, high + BORDER)
    labels = 0.5 * (low + high) + (0.5 * (high - low) + 0.16) * SIDES
    labels[:, 2] = content.floor
    shells = [solid.outline(view, 0.05) for solid in content.solids]
    tips = [f.position + TRIAD * f.rotation.T for f in content.frames]
    paths = [content.demonstrated, content.final, content.executed, *tips, scale_ends(view, low, high)]
    hands = [solid.outline(view) for arm in content.arms for solid in arm[-6:]]
    points = np.vstack([view.flat(corners), view.flat(np.vstack([*paths, labels])), *shells, *hands])
    return points.min(axis=0) - 0.01, points.max(axis=0) + TOP


def _stretched(low: np.ndarray, high: np.ndarray, ratio: float) -> tuple[np.ndarray, np.ndarray]:
    """Return the window widened or heightened to a ratio of width to height."""
    wanted = np.maximum(high - low, [ratio * (high - low)[1], (high - low)[0] / ratio])
    middle = 0.5 * (low + high)
    return middle - 0.5 * wanted, middle + 0.5 * wanted


def _paint(axes: Any, planned: ScenePlan, content: Content, view: DrawingView, every_plane: bool) -> None:
    paint_floor(axes, view, *room_of(content))
    for posture, arm in enumerate(content.arms):
        paint_arm(axes, view, arm, posture)
    shelled = [solid for solid, wanted in zip(content.solids, content.shelled, strict=True) if wanted]
    paint_shells(axes, view, shelled, planned.settings.repet.shell)
    for place, index in enumerate(back_to_front(content.solids, view)):
        paint_solid(axes, view, content.solids[index], 10.0 + 0.01 * place)
    tree = planned.plan.tree
    if tree is not None:
        paint_tree(axes, view, tree, planned.plan.path, content.solids, every=every_plane)
    for points in (content.final, content.executed):
        if len(points):
            below = np.column_stack([points[:, :2], np.full(len(points), content.floor)])
            axes.plot(*view.flat(below).T, color=SHADOW, linewidth=2.0, alpha=0.55, zorder=3.5)
    dashed = {"linestyle": (0, (4.5, 2.2)), "linewidth": 2.1, "zorder": 31}
    _paint_line(axes, content.demonstrated, content, view, color=DEMONSTRATED, **dashed)
    _paint_line(axes, content.final, content, view, color=FINAL, linewidth=3.6, zorder=30)
    if len(content.executed):
        _paint_line(axes, content.executed, content, view, color=FREE, linewidth=2.4, zorder=32)
    tips = [f.position + share * TRIAD * f.rotation.T for f in content.frames for share in (0.0, 0.5, 1.0)]
    lines = view.flat(np.vstack([content.demonstrated, content.final, content.executed, *tips]))
    for pose, label in zip(content.frames, ("start", "goal"), strict=True):
        _paint_frame(axes, pose, label, view, lines)


def _paint_line(axes: Any, points: np.ndarray, content: Content, view: DrawingView, **style: Any) -> None:
    """Draw a path, fainter where a solid is in front of it, with a white border below all paths."""
    flat, middles = view.flat(points), 0.5 * (points[1:] + points[:-1])
    start = 0
    for hidden, run in groupby(hidden_by(content.solids, middles, view)):
        count = len(list(run))
        piece = flat[start : start + count + 1].T
        axes.plot(*piece, alpha=HIDDEN if hidden else 1.0, solid_capstyle="round", **style)
        if not hidden:
            axes.plot(*piece, color="white", linewidth=style["linewidth"] + 1.8, alpha=0.7, zorder=29)
        start += count


def _paint_frame(axes: Any, pose: Pose, label: str, view: DrawingView, lines: np.ndarray) -> None:
    """Draw a triad and its label; the label stands where it is farthest from the points (n, 2) of all lines."""
    from matplotlib.patheffects import Normal, Stroke

    at = view.flat(pose.position)
    for k, color in enumerate(FRAME_COLORS):
        tip = view.flat(pose.position + TRIAD * pose.rotation[:, k])
        halo = [Stroke(linewidth=4.0, foreground="white"), Normal()]
        style = {"color": color, "linewidth": 2.4, "solid_capstyle": "round", "zorder": 35, "path_effects": halo}
        axes.plot(*np.stack([at, tip]).T, **style)
    axes.plot(*at, marker="o", markersize=5.5, color="0.1", markeredgecolor="white", markeredgewidth=0.9, zorder=36)
    directions = np.array([[x, y] for x, y in ((0, 1), (1, 0.5), (-1, 0.5), (1, -0.6), (-1, -0.6), (0, -1))])
    gaps = np.linalg.norm((at + LABEL * directions)[:, None] - lines, axis=2).min(axis=1)
    direction = directions[int(gaps.argmax())]
    axes.text(
        *(at + LABEL * direction), label, ha="center", va="center", fontsize=11, color="0.1", zorder=37,
        path_effects=[Stroke(linewidth=3.2, foreground="white"), Normal()],
    )  # fmt: skip


def _legend(figure: Any, planned: ScenePlan, content: Content) -> None:
    from matplotlib.lines import Line2D
    from matplotlib.patches import Patch

    entries: list[Any] = [
        Line2D([], [], color=DEMONSTRATED, linewidth=2.1, linestyle=(0, (4.5, 2.2)), label="demonstration"),
        Line2D([], [], color=FINAL, linewidth=3.6, label="final path"),
    ]
    if len(content.executed):
        entries.append(Line2D([], [], color=FREE, linewidth=2.4, label="collision-free path"))
    if content.solids:
        entries.append(Patch(facecolor="#e9b872", edgecolor="#8a5a17", alpha=0.75, label="obstacle"))
    if any(content.shelled):
        shell = planned.settings.repet.shell
        entries.append(
            Patch(facecolor="#f6e3c3", edgecolor="#d9a441", linestyle="--", label=f"shell, {100 * shell:.0f} cm")
        )
    tree = planned.plan.tree
    if tree is not None:
        entries.append(Patch(facecolor=PLANE, edgecolor=PLANE, alpha=0.35, label="tangent plane"))
        entries.append(Line2D([], [], color=KEPT, linewidth=0.9, label="tree edge"))
        if (tree.verdicts == 1).any():
            entries.append(Line2D([], [], color=REJECTED, linewidth=0.8, label="rejected edge"))
    names = ("arm at the start", "arm at the goal")
    entries += [arm_patch(k, label=name) for k, name in enumerate(names[: len(content.arms)])]
    figure.legend(
        handles=entries, loc="lower center", ncols=math.ceil(len(entries) / 2), frameon=False, fontsize=9.5,
        bbox_to_anchor=(0.5, 0.0), columnspacing=1.8, handlelength=2.0,
    )  # fmt: skip


def _title(planned: ScenePlan, certificate: Certificate | None) -> str:
    plan, title = planned.plan, planned.scene.config.title or planned.scene.name
    if not plan.success:
        return f"{title}: {plan.reason}"
    how = {"direct": "no detour needed", "joint search": "a search in joint space"}.get(plan.how, "an escape tree")
    kept = (
        "" if certificate is None or not content_matters(planned) else f", {1e3 * certificate.clearance:.0f} mm clear"
    )
    return f"{title}: {how}{kept}"


def content_matters(planned: ScenePlan) -> bool:
    """Return whether the scene has obstacles."""
    return bool(planned.scene.obstacles)
