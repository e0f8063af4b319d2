"""What a benchmark config may hold."""

from __future__ import annotations

import hashlib
import json
from difflib import get_close_matches
from pathlib import Path
from typing import Annotated, Any

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from ..planner.errors import BadConfig
from .loader import COMMAND_LINE, load_mapping, with_overrides


class RunConfig(BaseModel):
    """One method on one task at one level.

    Attributes:
        name: first part of the run folder's name.
        task: what to do, like "stack".
        method: the policy, like "screw".
        demonstration: name of a shipped demonstration, or a file.
        episodes: how many scenarios.
        level: how far they differ from the demonstration.
        robot: robosuite's name.
        seed: scenario k has the seed `seed + k`.
        obstacles: their kind; None: what the level says.
        env: more arguments of the environment, like `n_blocks` of stacking.
        max_seconds: simulated time limit of an episode; None: the task's own.
        video: make videos: of the first episode, and of the first failure of each kind.
        trajectories: keep what was measured at every tick, one .npz per episode.
        settings: of the method; see its own settings for the keys.
    """

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    name: Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
    task: str
    method: str = "screw"
    demonstration: str
    episodes: Annotated[int, Field(ge=1, le=1_000_000)] = 10
    level: str = "L1"
    robot: str = "Panda"
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0
    obstacles: str | None = None
    env: dict[str, Any] = Field(default_factory=dict)
    max_seconds: Annotated[float, Field(gt=0, le=3600)] | None = None
    video: bool = True
    trajectories: bool = False
    settings: dict[str, Any] = Field(default_factory=dict)

    def digest(self) -> str:
        """Twelve hexadecimal digits of the whole config."""
        text = json.dumps(self.model_dump(mode="json"), sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:12]


def load_config(path: str | Path, overrides: list[str] | None = None) -> RunConfig:
    """A config file with `key=value` changes, checked.

    Raises:
        BadConfig: naming the file, or the command line, and the key, and what is allowed.
    """
    changes = overrides or []
    values = with_overrides(load_mapping(path), changes)
    try:
        return RunConfig.model_validate(values)
    except ValidationError as error:
        first = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        changed = {text.partition("=")[0].split(".")[0] for text in changes}
        source = COMMAND_LINE if key.split(".")[0] in changed else path
        raise BadConfig(source, key, _reason(first)) from None


def _reason(error: Any) -> str:
    allowed = list(RunConfig.model_fields)
    if error["type"] == "extra_forbidden":
        close = get_close_matches(str(error["loc"][-1]), allowed, n=1)
        hint = f"did you mean {close[0]!r}? " if close else ""
        return f"unknown key; {hint}allowed: {', '.join(allowed)}"
    if error["type"] == "missing":
        return "is missing"
    return f"{error['msg'][0].lower()}{error['msg'][1:]}, got {error['input']!r}"
