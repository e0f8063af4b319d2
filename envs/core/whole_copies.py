"""Wrapper of a made environment whose copies share nothing with it."""

from __future__ import annotations

import copy
from typing import Any

import gymnasium as gym
from gymnasium.envs.registration import WrapperSpec
from gymnasium.utils import RecordConstructorArgs


class WholeCopies(gym.Wrapper[Any, Any, Any, Any], RecordConstructorArgs):
    """Outermost wrapper: `copy.copy` copies all that it wraps.

    A shallow copy of Gymnasium's wrappers would share the environment: a step of the one would be a step of the other.
    """

    def __init__(self, env: gym.Env[Any, Any]):
        RecordConstructorArgs.__init__(self)
        gym.Wrapper.__init__(self, env)

    def __copy__(self) -> WholeCopies:
        return copy.deepcopy(self)


WHOLE_COPIES = WrapperSpec("WholeCopies", f"{__name__}:WholeCopies", {})
"""The wrapper in the words of Gymnasium's registry."""
