"""The ids; registering imports neither MuJoCo nor robosuite."""

from __future__ import annotations

import gymnasium as gym

IDS = {
    "onedemo/Stack-v0": ("onedemo.envs.stacking:StackEnv", 3000),
    "onedemo/Shelve-v0": ("onedemo.envs.shelving:ShelveEnv", 4500),
    "onedemo/Pour-v0": ("onedemo.envs.pouring:PourEnv", 2000),
    "onedemo/BimanualPour-v0": ("onedemo.envs.bimanual_pouring:BimanualPourEnv", 2000),
}
"""Id: entry point and time limit in control steps."""


def register_all() -> None:
    """Make the ids known to Gymnasium; doing it twice does no harm."""
    for name, (entry_point, limit) in IDS.items():
        if name not in gym.registry:
            gym.register(name, entry_point=entry_point, max_episode_steps=limit)
