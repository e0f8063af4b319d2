"""Environment ids and their registration; registering imports neither MuJoCo nor robosuite."""

from __future__ import annotations

from typing import NamedTuple

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec


class Id(NamedTuple):
    """Registration data of an environment.

    Attributes:
        entry_point: import path of its class.
        seconds: time limit [s].
        frequency: default action frequency [Hz].
    """

    entry_point: str
    seconds: float
    frequency: int = 50

    @property
    def steps(self) -> int:
        """Time limit in actions."""
        return round(self.seconds * self.frequency)


IDS = {
    "onedemo/Stack-v0": Id("onedemo.envs.stack.stack_env:StackEnv", 60.0),
    "onedemo/Shelve-v0": Id("onedemo.envs.shelve.shelve_env:ShelveEnv", 90.0),
    "onedemo/Pour-v0": Id("onedemo.envs.pour.pour_env:PourEnv", 40.0),
    "onedemo/BimanualPour-v0": Id("onedemo.envs.pour.bimanual_pour_env:BimanualPourEnv", 40.0),
    "onedemo/Robosuite-v0": Id("onedemo.envs.guests.robosuite_env:RobosuiteEnv", 60.0),
    "onedemo/Reach-v0": Id("onedemo.envs.stack.reach_env:ReachEnv", 7.5, 20),
    "onedemo/PlaceOne-v0": Id("onedemo.envs.stack.place_one_env:PlaceOneEnv", 7.5, 20),
    "onedemo/TiltPour-v0": Id("onedemo.envs.pour.tilt_pour_env:TiltPourEnv", 7.5, 20),
    "onedemo/InsertOne-v0": Id("onedemo.envs.shelve.insert_one_env:InsertOneEnv", 7.5, 20),
}
"""Environments by id; those of 7.5 s are single motions of the other tasks, meant for training."""


WHOLE_COPIES = WrapperSpec("WholeCopies", "onedemo.envs.core.whole_copies:WholeCopies", {})


def register_all() -> None:
    """Register the ids with Gymnasium; repeated calls do no harm."""
    for name, kind in IDS.items():
        if name not in gym.registry:
            gym.register(name, kind.entry_point, max_episode_steps=kind.steps, additional_wrappers=(WHOLE_COPIES,))
