"""Logs of planned or executed motions: everything an independent verifier needs.

A log is one JSON file, its parts as in `log_json`; `sha256` is the digest of the canonically written content.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..arrays import checked_array, checked_file, checked_items, checked_kind, frozen
from ..errors import BadShape, OneDemoError, WrongType
from ..geometry.pose import Pose, PosePath
from ..geometry.shapes import Obstacle
from ..robot.arm import Arm
from ..robot.body import BODY, Body
from ..robot.kinematics import CHAIN
from ..strict_json import Refused, list_of, number_of, numbers_of, parsed, table_of, texts_of
from .log_json import (
    arm_of,
    body_of,
    content_of_arm,
    content_of_body,
    content_of_obstacle,
    obstacle_of,
    path_of,
    pose_of,
)

FORMAT_VERSION = 1
MAX_BYTES = 64 * 2**20
FARTHEST = 1e6
"""Largest plausible joint value [rad or m], time [s], position [m] or speed [m/s]; larger ones would overflow."""
CLAIMS = ("clearance", "position_error", "angle_error", "joint_margin", "deviation")
PROBLEM = ("arm", "body", "obstacles", "allowed", "goal", "safety", "demonstrated")
"""Keys of the request; the rest of a log is the answer."""
KEYS = ("format_version", *PROBLEM, "time", "joints", "claims")


class BadLog(OneDemoError, ValueError):
    """A motion log, or its file, is invalid."""

    def __init__(self, path: str | Path | None, key: str, reason: str):
        self.path, self.key, self.reason = path, key, reason
        super().__init__(f"{path or 'motion log'}: {key}: {reason}")


@dataclass(frozen=True, slots=True, eq=False)
class MotionLog:
    """A motion of an arm, its surroundings, and the claims about it.

    Attributes:
        arm: the arm that moves.
        body: capsules on the arm's joint frames, including those of held objects.
        obstacles: at time 0; they move at constant velocity.
        time: (n,) [s].
        joints: (n, dof) [rad or m]; between samples the motion is linear.
        safety: clearance [m] claimed from every obstacle without a margin of its own.
        goal: requested pose of the tcp at the end; None: no goal.
        demonstrated: path that the end of the motion should follow; None: no path.
        allowed: (body name, obstacle name) of intended contacts, which are not checked.
        claims: claims of the producer: clearance, position_error, joint_margin, deviation [m], angle_error [rad]; each
            of them may be absent.
        format_version: of the file.

    Raises:
        BadLog: an entry has the wrong shape, is not finite or contains an unknown name.
        WrongType: obstacles, allowed contacts or claims are of a wrong class.
    """

    arm: Arm
    body: Body
    obstacles: tuple[Obstacle, ...]
    time: np.ndarray
    joints: np.ndarray
    safety: float
    goal: Pose | None = None
    demonstrated: PosePath | None = None
    allowed: tuple[tuple[str, str], ...] = ()
    claims: Mapping[str, float] = field(default_factory=dict)
    format_version: int = FORMAT_VERSION

    def __post_init__(self):
        if self.format_version != FORMAT_VERSION:
            raise BadLog(None, "format_version", f"is {self.format_version!r}; this program knows {FORMAT_VERSION}")
        kinds = {"arm": Arm, "body": Body, "goal": Pose | None, "demonstrated": PosePath | None}
        for name, kind in kinds.items():
            if not isinstance(getattr(self, name), kind):
                raise BadLog(None, name, f"is a {type(getattr(self, name)).__name__}")
        for k, obstacle in enumerate(checked_items("obstacles", self.obstacles, object)):
            if not isinstance(obstacle, Obstacle):
                raise BadLog(None, f"obstacles[{k}]", f"is a {type(obstacle).__name__}, no obstacle")
        time = _checked("time", self.time, (None,))
        joints = _checked("joints", self.joints, (len(time), self.arm.dof))
        if not len(time):
            raise BadLog(None, "time", "has no samples")
        places = [[*o.pose.position, *o.velocity] for o in self.obstacles]
        _checked("obstacles", np.array(places).reshape(-1, 6), (None, 6))
        if np.abs(np.linalg.norm(self.arm.chain[:, CHAIN.rotation : CHAIN.offset], axis=1) - 1.0).max() > 1e-6:
            raise BadLog(None, "arm.chain", "holds a quaternion that is not of unit norm")
        if len(self.body) and self.body.rows[:, BODY.frame].max() >= self.arm.dof:
            raise BadLog(None, "body.rows", f"a capsule moves with a joint beyond the {self.arm.dof} of the arm")
        if not 0.0 <= _number("safety", self.safety) <= FARTHEST:
            raise BadLog(None, "safety", f"{self.safety!r} is not a length from 0 on")
        given = checked_kind("claims", self.claims, Mapping)
        claims = {key: _number(f"claims.{key}", value) for key, value in given.items()}
        unknown = sorted(set(claims) - set(CLAIMS))
        if unknown:
            raise BadLog(None, f"claims.{unknown[0]}", f"is unknown; allowed: {', '.join(CLAIMS)}")
        pairs = checked_items("allowed", self.allowed, Sequence)
        for k, pair in enumerate(pairs):
            if isinstance(pair, str) or len(pair) != 2 or not all(isinstance(name, str) for name in pair):
                raise BadLog(None, f"allowed[{k}]", "is not a pair of names")
        allowed = tuple(sorted({(mine, other) for mine, other in pairs}))
        for mine, other in allowed:
            if mine not in self.body.names or not other or other not in [o.name for o in self.obstacles]:
                raise BadLog(None, "allowed", f"{mine!r} with {other!r} is no part of the body with a named obstacle")
        for name, value in {"time": time, "joints": joints, "safety": float(self.safety)}.items():
            object.__setattr__(self, name, value)
        for name, value in {"claims": claims, "allowed": allowed, "obstacles": tuple(self.obstacles)}.items():
            object.__setattr__(self, name, value)


def content_of(log: MotionLog) -> dict[str, Any]:
    """Return the log as JSON content, without its digest."""
    return {
        "format_version": log.format_version,
        "arm": content_of_arm(log.arm),
        "body": content_of_body(log.body),
        "obstacles": [content_of_obstacle(obstacle) for obstacle in log.obstacles],
        "allowed": [list(pair) for pair in log.allowed],
        "goal": None if log.goal is None else log.goal.dq.tolist(),
        "safety": log.safety,
        "demonstrated": None if log.demonstrated is None else log.demonstrated.dqs.tolist(),
        "time": log.time.tolist(),
        "joints": log.joints.tolist(),
        "claims": dict(log.claims),
    }


def digest_of(log: MotionLog) -> str:
    """Return the SHA-256 digest of the canonically written content."""
    text = json.dumps(content_of(log), sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def write_log(log: MotionLog, path: str | Path) -> None:
    """Write a log to a JSON file.

    Args:
        log: the log.
        path: of the file, overwritten if present.

    Raises:
        WrongType: no log, or no path.
        BadLog: the log is larger than `read_log` accepts.
    """
    checked_kind("log", log, MotionLog)
    path = checked_file(path)
    text = json.dumps({**content_of(log), "sha256": digest_of(log)}, allow_nan=False)
    if len(text) > MAX_BYTES:
        raise BadLog(path, "file", f"would hold {len(text)} bytes; at most {MAX_BYTES} are read")
    path.write_text(text + "\n", encoding="utf-8")


def read_log(path: str | Path) -> MotionLog:
    """Read a log; every entry is checked, then the digest.

    Raises:
        WrongType: no path.
        BadLog: the file or one of its entries is invalid; the message names both.
    """
    path = checked_file(path)
    try:
        data = parsed(path, MAX_BYTES)
        version = data.get("format_version") if isinstance(data, dict) else None
        if type(version) is not int or version != FORMAT_VERSION:
            raise Refused("format_version", f"is {version!r}; this program reads {FORMAT_VERSION}")
        table_of("", data, (*KEYS, "sha256"))
        log = _log_from(data)
    except (Refused, BadLog) as error:
        raise BadLog(path, error.key, error.reason) from None
    if digest_of(log) != data["sha256"]:
        raise BadLog(path, "sha256", "does not belong to the content: the file was changed after it was written")
    return log


def _log_from(data: dict[str, Any]) -> MotionLog:
    goal, demonstrated, claims = data["goal"], data["demonstrated"], data["claims"]
    if not isinstance(claims, dict):
        raise Refused("claims", "is not a table")
    pairs = [texts_of(f"allowed[{k}]", pair) for k, pair in enumerate(list_of("allowed", data["allowed"]))]
    for k, pair in enumerate(pairs):
        if len(pair) != 2:
            raise Refused(f"allowed[{k}]", "is not a pair of names")
    arm = arm_of(data["arm"])
    return MotionLog(
        arm=arm,
        body=body_of(data["body"]),
        obstacles=tuple(
            obstacle_of(f"obstacles[{k}]", t) for k, t in enumerate(list_of("obstacles", data["obstacles"]))
        ),
        time=numbers_of("time", data["time"], (None,)),
        joints=numbers_of("joints", data["joints"], (None, arm.dof)),
        safety=number_of("safety", data["safety"]),
        goal=None if goal is None else pose_of("goal", goal),
        demonstrated=None if demonstrated is None else path_of("demonstrated", demonstrated),
        allowed=tuple((mine, other) for mine, other in pairs),
        claims={key: number_of(f"claims.{key}", value) for key, value in claims.items()},
    )


def _number(key: str, value: Any) -> float:
    try:
        return number_of(key, value)
    except Refused as error:
        raise BadLog(None, error.key, error.reason) from None


def _checked(key: str, value: Any, shape: tuple[int | None, ...]) -> np.ndarray:
    """Return a read-only copy, checked for its shape and for finite, plausible numbers."""
    try:
        array = frozen(checked_array(key, value, shape, finite=False))
    except WrongType:
        raise BadLog(None, key, "is not an array of numbers") from None
    except BadShape as error:
        raise BadLog(None, key, f"has shape {error.shape}; expected {error.expected}") from None
    bad = np.argwhere(~(np.abs(array) <= FARTHEST))
    if len(bad):
        raise BadLog(None, f"{key}[{bad[0][0]}]", f"is not finite, or above {FARTHEST:g}")
    return array
