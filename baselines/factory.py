"""Policies by name, their settings checked strictly."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from ..configs import BadConfig
from ..configs.dataclass_settings import settings_from, with_present_names
from ..configs.run_config import present_method
from ..envs import TaskDescription
from ..planner import Demonstration, Pose
from ..planner.errors import UnknownName
from ..planner.imitation.tsia import screw_path
from .key_poses import Join, sparse
from .learning.actor_card import METHOD
from .learning.learned_policy import METHODS, LearnedPolicy, LearnedSettings
from .learning.residual_policy import ResidualPolicy
from .motion.baseline_motions import (
    DecoupledSettings,
    DmpGoalSettings,
    DmpWorldSettings,
    PotentialSettings,
    ReplaySettings,
)
from .motion.path_generators import straight_path
from .motion.rrt_motion import RrtPolicySettings
from .own_policy import is_own, own_policy
from .policy import Policy
from .program_policy import ProgramPolicy
from .screw_policy import ScrewPolicy, ScrewSettings

OWN_TOOL = "moves the hand itself: only shipped policies can plan in another frame of the hand"


@dataclass(frozen=True, slots=True)
class PolicyKind:
    """A policy that a config may name.

    Attributes:
        settings: their dataclass.
        make: its constructor, given task, demonstration, settings and perhaps another frame of the hand.
        preset: settings that the name stands for.
        join: how it interpolates between key poses that are far apart.
    """

    settings: type
    make: Callable[..., Policy] = ProgramPolicy
    preset: Mapping[str, Any] = field(default_factory=dict)
    join: Join = screw_path


def _learned(
    name: str, task: TaskDescription, demonstration: Demonstration, settings: LearnedSettings, tool: Pose | None = None
) -> Policy:
    """A policy that has seen what it needed of the demonstration when it was trained."""
    if tool is not None:
        raise BadConfig("tool", name, OWN_TOOL)
    if name == METHOD:
        return ResidualPolicy.found(task, demonstration, settings)
    return LearnedPolicy.found(name, task, settings)


POLICIES = {
    "screw": PolicyKind(ScrewSettings, ScrewPolicy),
    "screw-trees-only": PolicyKind(ScrewSettings, ScrewPolicy, {"search": False}),
    "screw-search-only": PolicyKind(ScrewSettings, ScrewPolicy, {"trees": False}),
    "screw-guard-only": PolicyKind(ScrewSettings, ScrewPolicy, {"trees": False, "search": False}),
    "screw-no-guard": PolicyKind(ScrewSettings, ScrewPolicy, {"guard": False}),
    "screw-ee-only": PolicyKind(ScrewSettings, ScrewPolicy, {"whole_arm": False}),
    "tsia": PolicyKind(ScrewSettings, ScrewPolicy, {"trees": False, "search": False, "guard": False}),
    "decoupled": PolicyKind(DecoupledSettings, join=straight_path),
    "replay": PolicyKind(ReplaySettings, join=straight_path),
    "dmp-goal": PolicyKind(DmpGoalSettings, join=straight_path),
    "dmp-world": PolicyKind(DmpWorldSettings, join=straight_path),
    "potential": PolicyKind(PotentialSettings),
    "rrt": PolicyKind(RrtPolicySettings),
    **{name: PolicyKind(LearnedSettings, partial(_learned, name)) for name in (*METHODS, METHOD)},
}


def make_policy(
    name: str,
    task: TaskDescription,
    demonstration: Demonstration,
    settings: Mapping[str, Any] | None = None,
    *,
    key_poses: int | None = None,
    tool: Pose | None = None,
) -> Policy:
    """Make a policy for a task.

    Args:
        name: one of `POLICIES` or its former name, or a dotted path of your own, see `own_policy`.
        task: `env.unwrapped.task`.
        demonstration: the ONE demonstration.
        settings: the policy's settings as nested mappings; a missing key keeps its default.
        key_poses: number of poses of each segment that are shown; between them the policy interpolates in its own
            way, a policy of your own not at all. None: the whole demonstration is shown.
        tool: `tcp_from_tool` of another frame of the hand, in which motions are planned and followed; see
            `tool_frame`.

    Raises:
        UnknownName: no such policy.
        BadConfig: an unknown key, a wrong type, a value out of range, or another frame for your own policy.
    """
    if is_own(name):
        if tool is not None:
            raise BadConfig("tool", name, OWN_TOOL)
        shown = demonstration if key_poses is None else sparse(demonstration, key_poses)
        return own_policy(name, task, shown, settings or {})
    chosen, kind = settings_of(name, settings), POLICIES[present_method(name)]
    shown = demonstration if key_poses is None else sparse(demonstration, key_poses, kind.join)
    return kind.make(task, shown, chosen, tool)


def settings_of(name: str, settings: Mapping[str, Any] | None = None) -> Any:
    """Return the checked settings of a policy.

    Args:
        name: one of `POLICIES`, or its former name.
        settings: nested mappings; a missing key keeps its default.

    Raises:
        UnknownName: no such policy.
        BadConfig: an unknown key, a wrong type or a value out of range.
    """
    present = present_method(name)
    if present not in POLICIES:
        raise UnknownName("policy", name, POLICIES)
    kind, source = POLICIES[present], f"settings of {name!r}"
    given = with_present_names(kind.settings, settings or {}, source)
    return settings_from(kind.settings, {**kind.preset, **given}, source)
