"""Joints of a robot model, those that follow others, and those that are held."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from fnmatch import fnmatchcase
from typing import NamedTuple

import numpy as np
from numpy.polynomial import Polynomial

from ..errors import BadModel, told_apart
from ..geometry.pose import Pose

TURNS, SLIDES, OTHER = "turns", "slides", "other"
"""Kinds of joints; OTHER: free, planar and ball joints."""
ROUNDING = 1e-6
"""Excess over a limit [rad or m] that is rounding: such a joint is taken for one at the limit."""


class ModelJoint(NamedTuple):
    """A joint of a model.

    Attributes:
        name: of the joint.
        kind: TURNS, SLIDES or OTHER.
        axis: (3,) unit, in the frame of the body that the joint moves.
        position: (3,) a point on the axis in that frame [m].
        low: lower limit [rad or m]; -inf without.
        high: upper limit [rad or m]; inf without.
        rest: position in which the model places that body [rad or m].
    """

    name: str
    kind: str
    axis: np.ndarray
    position: np.ndarray
    low: float
    high: float
    rest: float

    def motion(self, value: float) -> Pose:
        """Return the displacement of the body from rest to a position [rad or m]; the identity for OTHER."""
        moved = value - self.rest
        if self.kind == TURNS:
            half = 0.5 * moved
            turn = Pose.from_position_quaternion(np.zeros(3), [math.cos(half), *(math.sin(half) * self.axis)])
            return Pose.from_position_quaternion(self.position - turn.rotation @ self.position, turn.quaternion)
        return Pose.from_position_quaternion(moved * self.axis if self.kind == SLIDES else np.zeros(3))


class Coupling(NamedTuple):
    """A joint that follows another one.

    Attributes:
        follower: name of the joint that follows.
        leader: name of the joint it follows; "" if it stands still.
        polynomial: coefficients of the follower's position [rad or m] in the leader's, from the constant on.
    """

    follower: str
    leader: str
    polynomial: tuple[float, ...]

    def at(self, leader: float) -> float:
        """Return the follower's position at a position of the leader."""
        return float(Polynomial(self.polynomial)(leader))

    def range(self, low: float, high: float) -> tuple[float, float]:
        """Return the lowest and highest position of the follower.

        Args:
            low: lower limit of the leader, finite.
            high: upper limit of the leader, finite.
        """
        turning = Polynomial(self.polynomial).deriv().roots() if len(self.polynomial) > 2 else np.zeros(0)
        inside = [float(root.real) for root in turning if abs(root.imag) < 1e-12 and low < root.real < high]
        reached = [self.at(value) for value in (low, high, *inside)]
        return min(reached), max(reached)


def held_positions(
    joints: Mapping[str, ModelJoint],
    couplings: Sequence[Coupling],
    locked: Mapping[str, float],
    before_base: Iterable[str],
    free: Iterable[str],
    source: str,
) -> dict[str, float]:
    """Return the positions [rad or m] of all joints that are held, in the order of the model.

    Args:
        joints: all joints of the model, by name.
        couplings: joints that follow others: a follower of a held joint is held.
        locked: position of each joint to hold, by name or shell pattern; a name counts more than a pattern.
        before_base: joints before the arm's base, held at rest, or at the nearer limit, unless locked.
        free: joints of the arm, which no pattern matches.
        source: name of the model for messages.

    Raises:
        BadModel: an unknown joint, a joint of the arm, a position that is not a number within the limits, or a joint
            that follows another one and cannot be locked by itself.
    """
    own = frozenset(free)
    leader_of = {coupling.follower: coupling for coupling in couplings}
    held: dict[str, float] = {}
    patterns = [key for key in locked if key not in joints]
    for pattern in patterns:
        matched = [name for name in joints if fnmatchcase(name, pattern)]
        if not matched:
            raise BadModel(source, f"locked joint {pattern!r}", f"not in the model; joints: {', '.join(joints)}")
        free_ones = [name for name in matched if name not in leader_of and name not in own]
        if not free_ones:
            reason = f"matches only joints of the arm, or joints that follow others: {', '.join(matched)}"
            raise BadModel(source, f"locked joint {pattern!r}", reason)
        held |= {name: _allowed(joints[name], locked[pattern], source) for name in free_ones if name not in locked}
    for name in (key for key in locked if key in joints):
        if name in own:
            raise BadModel(source, f"locked joint {name!r}", "is a joint of the arm")
        if name in leader_of:
            raise BadModel(source, f"locked joint {name!r}", _why_not_locked(leader_of[name]))
        held[name] = _allowed(joints[name], locked[name], source)
    for name in before_base:
        if name not in held and name not in leader_of:
            held[name] = min(max(joints[name].rest, joints[name].low), joints[name].high)
    for _ in couplings:  # a follower may lead another one
        for coupling in couplings:
            if coupling.leader in held or not coupling.leader:
                held[coupling.follower] = coupling.at(held.get(coupling.leader, 0.0))
    return {name: held[name] for name in joints if name in held}


def _why_not_locked(coupling: Coupling) -> str:
    """Say why a joint that follows another one cannot be locked by itself."""
    if coupling.leader:
        return f"follows {coupling.leader!r}: lock that one"
    return f"stands still at {coupling.at(0.0):g}, where the model couples it"


def _allowed(joint: ModelJoint, value: float, source: str) -> float:
    """Return the position at which a joint is to be held, if it may be."""
    key = f"locked joint {joint.name!r}"
    try:
        position = float(value)
    except (TypeError, ValueError):
        position = math.nan
    if not math.isfinite(position):
        raise BadModel(source, key, f"{value!r} is not a position [rad or m]")
    if joint.kind == OTHER and position != joint.rest:
        raise BadModel(source, key, f"{position:g}: a free, planar or ball joint stays where the model has it: 0")
    if not joint.low - ROUNDING <= position <= joint.high + ROUNDING:
        side, limit = ("upper", joint.high) if position > joint.high else ("lower", joint.low)
        at, end = told_apart(position, limit, 1)
        raise BadModel(source, key, f"{at} is beyond its {side} limit {end}")
    return min(max(position, joint.low), joint.high)


def check_independent(chain: Iterable[str], couplings: Iterable[Coupling], held: Mapping[str, float], source: str):
    """Refuse joints of an arm that follow another one: the arm's joints must be independent.

    Args:
        chain: names of the joints from the world to the tool.
        couplings: joints that follow others.
        held: held joints.
        source: name of the model for messages.

    Raises:
        BadModel: names the joint, and the one it follows.
    """
    leader_of = {coupling.follower: coupling.leader for coupling in couplings}
    for name in chain:
        if name in leader_of and name not in held:
            reason = f"follows {leader_of[name]!r}, so it is no joint of its own; lock {leader_of[name]!r} to hold both"
            raise BadModel(source, f"joint {name!r}", reason)


def swept_range(joint: ModelJoint, couplings: Iterable[Coupling], joints: Mapping[str, ModelJoint]) -> ModelJoint:
    """Return a joint with the range that it may take: its own, and where it follows another one within that one's.

    Args:
        joint: the joint.
        couplings: joints that follow others.
        joints: all joints, by name.
    """
    return _swept_range(joint, tuple(couplings), joints, ())


def _swept_range(
    joint: ModelJoint, couplings: tuple[Coupling, ...], joints: Mapping[str, ModelJoint], asked: tuple[str, ...]
) -> ModelJoint:
    """Return a joint with the range that it may take; `asked`: the joints that follow it, whose range is wanted."""
    ranges: list[tuple[float, float]] = []
    for coupling in couplings:
        if coupling.follower == joint.name and coupling.leader in joints and coupling.leader not in asked:
            leader = _swept_range(joints[coupling.leader], couplings, joints, (*asked, joint.name))
            if math.isfinite(leader.high - leader.low):
                ranges.append(coupling.range(leader.low, leader.high))
            elif joint.kind == TURNS:
                ranges.append((-math.inf, math.inf))
    if not ranges:
        return joint
    if math.isfinite(joint.high - joint.low):
        ranges.append((joint.low, joint.high))
    return joint._replace(low=min(low for low, _ in ranges), high=max(high for _, high in ranges))
