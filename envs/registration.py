"""Registration of the environment ids; registering imports neither MuJoCo nor robosuite."""

from __future__ import annotations

import gymnasium as gym

from .core.whole_copies import WHOLE_COPIES
from .shipped import IDS


def register_all() -> None:
    """Register the ids with Gymnasium; repeated calls do no harm."""
    for name, facts in IDS.items():
        if name not in gym.registry:
            gym.register(name, facts.entry_point, max_episode_steps=facts.steps, additional_wrappers=(WHOLE_COPIES,))
