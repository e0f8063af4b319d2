"""The judge of plans and executed motions: recomputes every claim by independent means.

Distances come from fcl, kinematics from Pinocchio, and bounds between samples from `sweep`. Not judged: self-collision
of the arm, whether the capsules contain the real arm, and dynamics.
"""

from __future__ import annotations

import json
import math
from collections.abc import Iterator
from dataclasses import asdict, dataclass
from pathlib import Path

import numpy as np

from ..arrays import checked_kind, checked_settings
from ..errors import told_apart
from ..log.motion_log import PROBLEM, MotionLog, content_of, digest_of
from ..ranges import check_range
from ..robot.body import BODY
from ..robot.joint_limits import beyond_limit
from .contacts import contact_excess
from .deviation import deviation_of
from .sweep import Sweep, Sweeper, SweepSettings

FORMAT_VERSION = 1
POSITION_ERROR, ANGLE_ERROR = 0.005, 0.05
"""Largest errors [m], [rad] of a reached goal; smaller claimed errors apply instead."""
UNITS = {"clearance": "m", "position_error": "m", "angle_error": "rad", "joint_margin": "rad or m", "deviation": "m"}
"""Units of the claims."""
SPEED_EXCESS = 1e-6
"""Relative tolerance of joint speeds, for rounding."""
CLAIM_GAP = 1e-5
"""Tolerance [m] in proving a claimed clearance: the last micrometers take too many halvings."""
CONTACT_ROOM = 0.006
"""Distance [m] by which an allowed contact may be deeper on the way than at the ends of the motion."""


@dataclass(frozen=True, slots=True)
class Certificate:
    """The findings of a judge about a motion.

    Attributes:
        ok: all requirements and all claims hold.
        reasons: violations, one line each; empty if ok.
        clearance: smallest distance [m] of the body to the obstacles, also between samples, except allowed contacts:
            a certified lower bound (up to fcl's own rounding, below 1e-7 m), inf if there are no obstacles.
        sampled_clearance: smallest distance found [m]; the true clearance lies between the two.
        clearances: the certified bound [m] by name of the body's parts.
        joint_margin: smallest distance to a joint limit [rad or m]; negative outside.
        speed_ratio: largest joint speed over its limit.
        position_error: of the last pose from the goal [m]; None: no goal.
        angle_error: of the last pose from the goal [rad]; None: no goal.
        deviation: largest weighted distance of the motion's end to the demonstrated path [m] (see `deviation`), both
            traversed in order; None: no path.
        deviation_gap: the true deviation is smaller by at most this [m].
        contact_excess: how much deeper [m] the motion is in any allowed contact than at its deeper end: an upper bound,
            also between samples; 0 without allowed contacts.
        intervals: number of examined pairs of a capsule and an obstacle over an interval.
        log_sha256: digest of the log.
    """

    ok: bool
    reasons: tuple[str, ...]
    clearance: float
    sampled_clearance: float
    clearances: dict[str, float]
    joint_margin: float
    speed_ratio: float
    position_error: float | None
    angle_error: float | None
    deviation: float | None
    deviation_gap: float
    contact_excess: float
    intervals: int
    log_sha256: str

    def to_json(self) -> str:
        """Return the certificate as JSON text; infinite numbers become null."""
        table = {"format_version": FORMAT_VERSION, **asdict(self)}
        return json.dumps(_finite(table), allow_nan=False, indent=1)

    def write(self, path: str | Path) -> None:
        """Write the certificate to a JSON file."""
        Path(path).write_text(self.to_json() + "\n", encoding="utf-8")


def certify(
    log: MotionLog,
    *,
    expected: MotionLog | None = None,
    tolerance: float = 1e-6,
    settings: SweepSettings | None = None,
) -> Certificate:
    """Judge a motion.

    Args:
        log: the motion and its claims.
        expected: a log whose problem (arm, body, obstacles, allowed, goal, safety, and demonstrated if present) must
            equal the judged log's problem, whatever its own motion; None: any problem.
        tolerance: [m], [rad] by which distances may be too small, claims too good, and joints beyond a limit.
        settings: resolution of the examination between samples; default: `SweepSettings()`.

    Returns:
        The findings, in every case: a rejected motion is not an error.

    Raises:
        WrongType, BadOption: an argument is of a wrong class, or the tolerance is negative.
    """
    checked_kind("log", log, MotionLog)
    if expected is not None:
        checked_kind("expected", expected, MotionLog)
    check_range("tolerance", tolerance, "[0, inf)")
    settings, required = checked_settings(SweepSettings, settings), _required(log)
    claimed = log.claims.get("clearance", -math.inf)
    sweeper = Sweeper(log, required - tolerance, claimed - 0.5 * CLAIM_GAP, settings)
    sweep = sweeper.run()
    errors = _goal_errors(log, sweeper.moment.tool[-1])
    deviation, gap = None, 0.0
    if log.demonstrated is not None:
        deviation, gap = deviation_of(sweeper.kinematics, log)
    excess, contacts = contact_excess(log, _allowed(log), _margins(log), CONTACT_ROOM, settings)
    margins = np.minimum(log.joints - log.arm.lower, log.arm.upper - log.joints)
    checked = np.isfinite(required)
    certificate = Certificate(
        ok=False,
        reasons=(),
        clearance=_smallest(sweep.certified[checked]),
        sampled_clearance=_smallest(sweep.sampled[checked]),
        clearances=_by_name(log, sweep),
        joint_margin=float(margins.min()),
        speed_ratio=float(_speed_ratios(log).max(initial=0.0)),
        position_error=errors[0],
        angle_error=errors[1],
        deviation=deviation,
        deviation_gap=gap,
        contact_excess=float(excess.max(initial=0.0)),
        intervals=sweep.intervals,
        log_sha256=digest_of(log),
    )
    reasons = (
        *_problem_reasons(log, expected),
        *_motion_reasons(log, margins, tolerance),
        *_clearance_reasons(log, sweep, required, tolerance),
        *_contact_reasons(log, contacts, excess, tolerance),
        *_goal_reasons(log, certificate, tolerance),
        *_claim_reasons(log, certificate, tolerance),
    )
    fields = {name: getattr(certificate, name) for name in Certificate.__slots__}
    return Certificate(**{**fields, "ok": not reasons, "reasons": reasons})


def _required(log: MotionLog) -> np.ndarray:
    """Return required distances (m, k) [m]; -inf for allowed contacts and between the base and standing obstacles.

    The base cannot run into a standing obstacle: its place is not part of a motion.
    """
    fixed = log.body.rows[:, BODY.frame] < 0
    standing = np.array([not obstacle.velocity.any() for obstacle in log.obstacles], dtype=bool)
    return np.where(_allowed(log) | (fixed[:, None] & standing), -math.inf, _margins(log))


def _margins(log: MotionLog) -> np.ndarray:
    """Return the distances (k,) [m] to keep from the obstacles."""
    return np.array([log.safety if o.margin is None else o.margin for o in log.obstacles], dtype=np.float64)


def _allowed(log: MotionLog) -> np.ndarray:
    """Return which capsules may touch which obstacles (m, k)."""
    pairs = [[(mine, o.name) in log.allowed for o in log.obstacles] for mine in log.body.names]
    return np.array(pairs, dtype=bool).reshape(len(log.body), len(log.obstacles))


def _smallest(values: np.ndarray) -> float:
    return float(values.min(initial=math.inf))


def _by_name(log: MotionLog, sweep: Sweep) -> dict[str, float]:
    names = np.array(log.body.names)
    return {str(name): _smallest(sweep.certified[names == name]) for name in dict.fromkeys(log.body.names)}


def _speed_ratios(log: MotionLog) -> np.ndarray:
    """Return the ratios (n - 1, dof) of joint speeds to their limits; inf where a joint moves in zero time."""
    dq, dt = np.abs(np.diff(log.joints, axis=0)), np.diff(log.time)[:, None]
    ratios = np.where(dq > 0, math.inf, 0.0)
    return np.divide(dq, dt * log.arm.velocity_limits, out=ratios, where=np.broadcast_to(dt > 0, dq.shape))


def _goal_errors(log: MotionLog, world_from_tcp: np.ndarray) -> tuple[float | None, float | None]:
    if log.goal is None:
        return None, None
    turn = world_from_tcp[:3, :3].T @ log.goal.rotation
    sine = 0.5 * np.linalg.norm([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    angle = math.atan2(sine, 0.5 * (np.trace(turn) - 1.0))
    return float(np.linalg.norm(world_from_tcp[:3, 3] - log.goal.position)), angle


def _problem_reasons(log: MotionLog, expected: MotionLog | None) -> Iterator[str]:
    if expected is None:
        return
    mine, theirs = content_of(log), content_of(expected)
    for key in PROBLEM:
        if mine[key] != theirs[key] and (key != "demonstrated" or theirs[key] is not None):
            yield f"problem: {key} is not that of the expected problem"


def _motion_reasons(log: MotionLog, margins: np.ndarray, tolerance: float) -> Iterator[str]:
    late = np.flatnonzero(np.diff(log.time) <= 0)
    if len(late):
        k = late[0]
        first, second = told_apart(log.time[k], log.time[k + 1], 2)
        yield f"time: does not rise from {first} s to {second} s at index {k + 1}"
    k, j = np.unravel_index(margins.argmin(), margins.shape)
    if margins[k, j] < -tolerance:
        yield f"limits: {beyond_limit(log.arm, log.joints[k])} at index {k}"
    ratios = _speed_ratios(log)
    if ratios.size and ratios.max() > 1.0 + SPEED_EXCESS:
        k, j = np.unravel_index(ratios.argmax(), ratios.shape)
        ratio, _ = told_apart(ratios[k, j], 1.0, 2)
        yield f"speed: {log.arm.joint_names[j]} moves at {ratio} times its limit after index {k}"


def _clearance_reasons(log: MotionLog, sweep: Sweep, required: np.ndarray, tolerance: float) -> Iterator[str]:
    if not sweep.complete:
        yield f"clearance: undecided after {sweep.intervals} intervals"
    short = sweep.certified < required - tolerance
    for name in dict.fromkeys(log.body.names):
        mine = np.array([name == other for other in log.body.names])
        for o in np.flatnonzero(short[mine].any(axis=0)):
            k = np.flatnonzero(mine)[(sweep.certified[mine, o] - required[mine, o]).argmin()]
            found, proven = sweep.sampled[k, o], sweep.sampled[k, o] < required[k, o] - tolerance
            near, kept = told_apart(1e3 * (found if proven else sweep.certified[k, o]), 1e3 * required[k, o], 1)
            state = f"{near} mm from" if proven else f"not proven beyond {near} mm from"
            what = f"at least {-1e3 * found:.1f} mm inside" if found < 0 else state
            where = f"{log.obstacles[o].name or f'obstacle {o}'} at {sweep.when[k, o]:.4g} s"
            yield f"clearance: {name} is {what} {where}; {kept} mm must be kept"


def _contact_reasons(log: MotionLog, sweep: Sweep, excess: np.ndarray, tolerance: float) -> Iterator[str]:
    if not sweep.complete:
        yield f"contacts: undecided after {sweep.intervals} intervals"
    for o in np.flatnonzero(excess > CONTACT_ROOM + tolerance):
        k = int(sweep.certified[:, o].argmin())
        where = f"{log.obstacles[o].name} at {sweep.when[k, o]:.4g} s"
        deeper, most = told_apart(1e3 * excess[o], 1e3 * CONTACT_ROOM, 1)
        name = log.body.names[k]
        yield f"contacts: {name} is up to {deeper} mm deeper in {where} than at the motion's ends; at most {most} mm"


def _goal_reasons(log: MotionLog, found: Certificate, tolerance: float) -> Iterator[str]:
    for key, unit, most in (("position_error", "m", POSITION_ERROR), ("angle_error", "rad", ANGLE_ERROR)):
        value = getattr(found, key)
        if value is not None and value > most + tolerance:
            found_, allowed = told_apart(value, most, 3)
            yield f"goal: {key} is {found_} {unit}; at most {allowed}"


def _claim_reasons(log: MotionLog, found: Certificate, tolerance: float) -> Iterator[str]:
    for key, claimed in log.claims.items():
        value, what = getattr(found, key), "the truth"
        if value is None:
            yield f"claims.{key}: {claimed:.6g} is claimed, but the log holds nothing to compare with"
            continue
        if key == "clearance":
            wrong = claimed > found.sampled_clearance + tolerance
            what = what if wrong else "all that is proven"
            value = found.sampled_clearance if wrong else value
            wrong = wrong or claimed > value + CLAIM_GAP
        elif key == "joint_margin":
            wrong = claimed > value + tolerance
        else:
            wrong = claimed < value - tolerance - (found.deviation_gap if key == "deviation" else 0.0)
        if wrong:
            one, other = told_apart(claimed, value, 4)
            yield f"claims.{key}: {one} {UNITS[key]} is claimed, {other} is {what}"


def _finite(value: object) -> object:
    if isinstance(value, dict):
        return {key: _finite(item) for key, item in value.items()}
    return None if isinstance(value, float) and not math.isfinite(value) else value
