"""Policies, the planner's own among them, on one footing.

The names below are the public face; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..planner.lazy_names import lazy_names

if TYPE_CHECKING:
    from .factory import POLICIES as POLICIES
    from .factory import make_policy as make_policy
    from .learning.actor_files import load_actor as load_actor
    from .learning.actor_files import save_actor as save_actor
    from .learning.export_actor import actor_of as actor_of
    from .learning.feature_scaling import FlatFeatures as FlatFeatures
    from .learning.feature_scaling import measured_normalization as measured_normalization
    from .learning.features import Features as Features
    from .learning.learned_policy import LearnedPolicy as LearnedPolicy
    from .learning.residual_policy import AroundScrew as AroundScrew
    from .learning.task_demonstrations import task_episode as task_episode
    from .motion.path_generators import GeneratedPath as GeneratedPath
    from .motion.path_generators import PathGenerator as PathGenerator
    from .policy import (
        EpisodePolicy as EpisodePolicy,
    )
    from .policy import (
        LabeledPath as LabeledPath,
    )
    from .policy import (
        Policy as Policy,
    )
    from .policy import (
        PolicyReport as PolicyReport,
    )
    from .program_policy import ProgramPolicy as ProgramPolicy
    from .recording.scripted_recorder import ScriptedMotion as ScriptedMotion
    from .recording.scripted_recorder import Waypoint as Waypoint
    from .safe_actions import SafeActions as SafeActions
    from .screw_policy import ScrewPolicy as ScrewPolicy
    from .screw_policy import ScrewSettings as ScrewSettings

__all__ = [
    "POLICIES",
    "AroundScrew",
    "EpisodePolicy",
    "Features",
    "FlatFeatures",
    "GeneratedPath",
    "LabeledPath",
    "LearnedPolicy",
    "PathGenerator",
    "Policy",
    "PolicyReport",
    "ProgramPolicy",
    "SafeActions",
    "ScrewPolicy",
    "ScrewSettings",
    "ScriptedMotion",
    "Waypoint",
    "actor_of",
    "load_actor",
    "make_policy",
    "measured_normalization",
    "save_actor",
    "task_episode",
]

if not TYPE_CHECKING:  # a type checker would take any name for known
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".factory": (
                "POLICIES",
                "make_policy",
            ),
            ".learning.actor_files": (
                "load_actor",
                "save_actor",
            ),
            ".learning.export_actor": ("actor_of",),
            ".learning.feature_scaling": (
                "FlatFeatures",
                "measured_normalization",
            ),
            ".learning.features": ("Features",),
            ".learning.learned_policy": ("LearnedPolicy",),
            ".learning.residual_policy": ("AroundScrew",),
            ".learning.task_demonstrations": ("task_episode",),
            ".motion.path_generators": (
                "GeneratedPath",
                "PathGenerator",
            ),
            ".policy": (
                "EpisodePolicy",
                "LabeledPath",
                "Policy",
                "PolicyReport",
            ),
            ".program_policy": ("ProgramPolicy",),
            ".recording.scripted_recorder": (
                "ScriptedMotion",
                "Waypoint",
            ),
            ".safe_actions": ("SafeActions",),
            ".screw_policy": (
                "ScrewPolicy",
                "ScrewSettings",
            ),
        },
    )
