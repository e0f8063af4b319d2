"""`onedemo plan`: a scene in; a plan, the judge's verdict and a picture out."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ...configs import BadConfig
from ...configs.plan_scene import PlanScene, load_scene, pose_of, shipped_scene
from ...configs.plan_scene_schema import RobotFile
from ...planner import (
    Arm,
    Body,
    Certificate,
    Obstacle,
    Plan,
    Planner,
    PlanSettings,
    Pose,
    PosePath,
    Sphere,
    certify,
    smoothed,
    write_log,
)
from ...planner.errors import BadModel, PlanFailed
from ...planner.planning import refine
from ...planner.planning.planning_scene import PlanningScene
from ...planner.planning.refine import ACCELERATION, refused
from ...planner.safety.robot_checks import contact_masks
from ..console import console, counted, labeled
from ..robot.load_robot import RobotRequest, kind_of, load_robot
from ..robot.robot_summary import postures_of
from .scene_plan import ScenePlan

FOUND, NOT_FOUND, REFUSED = 0, 1, 3
"""Exit codes. REFUSED: the judge rejects the plan, which must never happen."""
FIGURES = (".png", ".pdf", ".svg")
"""Allowed suffixes of a picture."""


def run_plan(
    scene: str,
    overrides: list[str],
    figure: Path | None,
    output: Path | None,
    *,
    judged: bool = True,
    smooth: bool = False,
    timed: bool = False,
) -> int:
    """Plan in a scene, print the result and write the requested files.

    Args:
        scene: YAML file, or the name of a shipped scene.
        overrides: `key=value` changes to the scene.
        figure: picture to write, its format given by the suffix; None: no picture.
        output: file for the plan as a log that the judge (`certify`) reads; None: no log.
        judged: let the independent judge check the plan.
        smooth: smooth the plan along a C1 curve; see `refine.smoothed`.
        timed: time the plan under limits; see `refine.timed`.

    Returns:
        The exit code: `FOUND`, `NOT_FOUND` or `REFUSED`.

    Raises:
        BadConfig: the scene, an override or a file to write cannot be used.
    """
    if figure is not None and figure.suffix.lower() not in FIGURES:
        raise BadConfig("command line", "--figure", f"{figure} does not end in {', '.join(FIGURES)}")
    loaded = load_scene(scene_path(scene), overrides)
    err = console(stderr=True)
    with err.status("building the arm and the planner (compiled on first use: about a minute)"):
        planned = refined(plan_in(loaded), smooth=smooth, timed=timed)
    certificate = certify(planned.plan.log()) if judged and planned.plan.success else None
    out = console()
    for label, style, text in _lines(planned, certificate):
        out.print(labeled(label, style, text))
    if output is not None and planned.plan.success:
        _written("--output", output, lambda: write_log(planned.plan.log(), output))
        out.print(f"plan        {output}")
    elif output is not None:
        err.print(labeled("note", "yellow", f"there is no plan, so {output} was not written"))
    if figure is not None:
        from .figure import draw_plan

        _written("--figure", figure, lambda: draw_plan(planned, certificate, [figure]))
        out.print(f"figure      {figure}")
    if not planned.plan.success:
        return NOT_FOUND
    return FOUND if certificate is None or certificate.ok else REFUSED


def scene_path(scene: str) -> Path:
    """Return the path of a scene file, or of the shipped scene with this name or source-tree path.

    Raises:
        BadConfig: no such file.
    """
    path = Path(scene)
    if path.is_file():
        return path
    if path.suffix in ("", ".yaml") and str(path.parent) in (".", "configs/scenes"):
        return shipped_scene(path.stem)
    raise BadConfig(path, "", "no such file")


def plan_in(scene: PlanScene) -> ScenePlan:
    """Plan in a scene.

    Raises:
        BadConfig: the robot, the start, the settings or a name in the scene cannot be used.
    """
    from ...configs.dataclass_settings import settings_from

    settings = settings_from(PlanSettings, scene.config.settings, f"{scene.source}: settings")
    arm, body, home = _robot(scene)
    start = home
    if scene.config.start != "home":
        with scene.blaming("start"):
            start = arm.checked(np.array(scene.config.start, dtype=np.float64))
    if scene.held is not None:
        with scene.blaming("held"):
            body = body.holding(scene.held.name, scene.held.shape, scene.held.tcp_from_object, arm)
    with scene.blaming("allowed"):
        contact_masks(body.names, scene.obstacles, scene.allowed)
    planner = Planner(arm, body, settings)
    _warm_up(planner, start)
    with scene.blaming("obstacles"):
        plan = planner.plan(
            scene.demonstrated, start, scene.goal, scene.obstacles, allowed=scene.allowed, seed=scene.config.seed
        )
    return ScenePlan(scene, arm, body, start, settings, plan)


def refined(planned: ScenePlan, *, smooth: bool, timed: bool) -> ScenePlan:
    """Smooth and time a plan as requested; the plan fails if the refined motion does not stay clear.

    Args:
        planned: the scene and its plan.
        smooth: see `refine.smoothed`.
        timed: see `refine.timed`.
    """
    plan = planned.plan
    if not plan.success:
        return planned
    try:
        plan = smoothed(plan) if smooth else plan
        plan = refine.timed(plan) if timed else plan
    except PlanFailed as failure:
        plan = refused(plan, failure)
    return planned._replace(plan=plan)


def _robot(scene: PlanScene) -> tuple[Arm, Body, np.ndarray]:
    """Return arm, body and usual joints (dof,) [rad] of the scene's robot."""
    robot = scene.config.robot
    if isinstance(robot, RobotFile):
        return _robot_of_file(scene, robot)
    from ...envs.scene.robot_bodies import robot_body
    from ...envs.scene.robots import robot_named
    from ...envs.scene.scene import compiled_scene

    with scene.blaming("robot"):
        known = robot_named(robot)
    compiled = compiled_scene(known)
    return compiled.arms[0].arm, robot_body(known), compiled.home[0]


def _robot_of_file(scene: PlanScene, robot: RobotFile) -> tuple[Arm, Body, np.ndarray]:
    folders = robot.package_dirs
    with scene.blaming("robot.base"):
        base = None if robot.base is None else pose_of(robot.base)
    request = RobotRequest(
        scene.file(robot.urdf or robot.mjcf or ""),
        robot.tool if robot.tcp_frame is None else robot.tcp_frame,
        velocity_limits=robot.velocity_limits,
        base=base,
        base_link=robot.base_link,
        locked=robot.locked,
        package_dirs=None if folders is None else [scene.file(folder) for folder in folders],
        srdf=None if robot.srdf is None else scene.file(robot.srdf),
        visuals=robot.visuals,
    )
    with scene.blaming("robot"):
        expected = "robot" if robot.urdf is not None else "mujoco"
        if kind_of(request.file) != expected:
            raise BadModel(request.file, "urdf" if robot.urdf is not None else "mjcf", f"has no <{expected}>")
        loaded = load_robot(request)
    low, high = postures_of(loaded.arm)
    return loaded.arm, loaded.body, 0.5 * (low + high)


def _warm_up(planner: Planner, start: np.ndarray) -> None:
    """Load the compiled loops, so that the plan's time contains planning only."""
    here = planner.arm.fk(start)
    far = Obstacle(Sphere(0.01), Pose.from_position_quaternion((0.0, 0.0, 50.0)))
    planner.plan(PosePath(here.dq[None]), start, here, (far,))


def _lines(planned: ScenePlan, certificate: Certificate | None) -> Iterator[tuple[str, str, str]]:
    """Yield label, style and text of every line for the terminal."""
    plan, name = planned.plan, planned.scene.name
    for warning in planned.arm.report.warnings:
        yield "warning   ", "yellow", warning
    spent = f"in {_time(plan.seconds)}, {plan.tries} {'try' if plan.tries == 1 else 'tries'}"
    if not plan.success:
        yield "not found ", "red", f"{name}: {plan.why}; {spent}"
        if plan.tree is not None:
            kept = int((plan.tree.verdicts == 0).sum())
            yield (
                "looked at ",
                "",
                f"{counted(len(plan.tree.poses), 'node')} in the last escape tree, {kept} of them kept",
            )
        return
    seconds = plan.dt * (len(plan.joints) - 1)
    yield "found     ", "green", f"{name}: {_how(plan)}, {spent}; the motion takes {seconds:.1f} s"
    yield "clearance ", "", _clearance(planned, certificate)
    if certificate is not None and plan.request.allowed:
        deeper = f"{1e3 * certificate.contact_excess:.1f} mm"
        yield "contacts  ", "", f"on the way at most {deeper} deeper than at the ends, where allowed"
    yield "joints    ", "", f"{plan.margin:.2f} rad from a limit at the least; {_pace(planned)}"
    if certificate is None:
        yield "not judged", "yellow", "see --certify"
    elif certificate.ok:
        errors = f"{1e3 * (certificate.position_error or 0.0):.1f} mm, {np.degrees(certificate.angle_error or 0.0):.1f}"
        yield "judged    ", "green", f"sound by other means (fcl, Pinocchio); at the goal within {errors} degrees"
    else:
        yield "judged    ", "red", f"REFUSED: {'; '.join(certificate.reasons)}"
    if any(np.any(o.velocity) for o in planned.scene.obstacles):
        yield "note      ", "yellow", "moving obstacles: planned as if they stood still, judged as they move"


def _how(plan: Plan) -> str:
    ways = {"direct": "as demonstrated, no detour", "joint search": "by a search in joint space"}
    found = ways.get(plan.how, f"{counted(plan.detours, 'detour')} by escape trees")
    return ", ".join((found, *plan.refined))


def _pace(planned: ScenePlan) -> str:
    plan = planned.plan
    if "timed" in plan.refined:
        speeds = np.abs(np.diff(plan.joints, axis=0)) / plan.dt / planned.arm.velocity_limits
        return f"{speeds.max(initial=0.0):.0%} of the speed limits and up to {ACCELERATION:g} rad/s^2"
    return f"safety layer at work in {plan.changed / max(len(plan.joints) - 1, 1):.0%}"


def _clearance(planned: ScenePlan, certificate: Certificate | None) -> str:
    if not planned.scene.obstacles:
        return "nothing to touch"
    if certificate is not None:
        closest = min(certificate.clearances, key=certificate.clearances.__getitem__)
        return f"{1e3 * certificate.clearance:.1f} mm at the least ({closest}), between the ticks too; {_kept(planned)}"
    scene = planned.scene
    work = PlanningScene.of(planned.arm, planned.body, scene.obstacles, planned.settings, scene.allowed)
    slack = min(work.slack(q) for q in planned.plan.joints)
    return f"{1e3 * slack:.1f} mm more than must be kept, at the ticks"


def _kept(planned: ScenePlan) -> str:
    """Return the distances that must be kept: the general one, and an obstacle's own."""
    obstacles = planned.scene.obstacles
    names = [obstacle.name or f"obstacle {k}" for k, obstacle in enumerate(obstacles)]
    margins = {name: o.margin for name, o in zip(names, obstacles, strict=True) if o.margin is not None}
    own = [f"{1e3 * margin:g} mm from {name}" for name, margin in margins.items()]
    general = [f"{1e3 * planned.settings.safety.distance:g} mm"] if len(own) < len(obstacles) else []
    return f"{', '.join([*general, *own])} must be kept"


def _time(seconds: float) -> str:
    return f"{1e3 * seconds:.1f} ms" if seconds < 1.0 else f"{seconds:.1f} s"


def _written(option: str, path: Path, write: Any) -> None:
    try:
        write()
    except OSError as error:
        raise BadConfig("command line", option, f"{path}: {error.strerror or type(error).__name__}") from None
