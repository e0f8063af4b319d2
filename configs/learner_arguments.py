"""Arguments of learners: defaults, which are part of a training's digest, and allowed values."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from .run_config import reason_of

OFF_POLICY: dict[str, Any] = {
    "hidden": [128, 128],
    "learning_rate": 5e-4,
    "gamma": 0.95,
    # an update takes two to four times as long as a step of the environment
    "batch_size": 256,
    "train_freq": 2,
    "learning_starts": 1000,
    "buffer_size": 1_000_000,
    # starting from 1, the entropy bonus hides these rewards for the first 20 000 steps
    "ent_coef": "auto_0.01",
}
PPO: dict[str, Any] = {
    "hidden": [128, 128],
    "envs": 4,
    "learning_rate": 1e-3,
    "gamma": 0.95,
    "n_steps": 256,
    "batch_size": 256,
    "n_epochs": 5,
    "ent_coef": 0.0,
}
DEFAULTS: dict[str, dict[str, Any]] = {
    "sac": OFF_POLICY,
    "sac-demo": OFF_POLICY,
    "residual": OFF_POLICY,
    "sac-her": {**OFF_POLICY, "n_sampled_goal": 4, "buffer_size": 200_000},
    "ppo": PPO,
    "bc": {"hidden": [128, 128], "learning_rate": 1e-3, "batch_size": 64},
}
"""Arguments by algorithm. `hidden`: widths of the hidden layers; `envs`: environments stepped at once in one
process; `n_sampled_goal`: hindsight goals per transition. The others are the library's own arguments."""
Count = Annotated[int, Field(ge=1, strict=True)]
Above = Annotated[float, Field(gt=0)]
Share = Annotated[float, Field(ge=0, le=1)]
KINDS: dict[str, Any] = {
    "hidden": Annotated[list[Count], Field(min_length=1)],
    "learning_rate": Above,
    "gamma": Share,
    "tau": Annotated[float, Field(gt=0, le=1)],
    "gae_lambda": Share,
    "max_grad_norm": Above,
    "learning_starts": Annotated[int, Field(ge=0, strict=True)],
    **dict.fromkeys(("batch_size", "buffer_size", "n_steps", "n_epochs", "envs", "n_sampled_goal"), Count),
}
"""Allowed values of common arguments; the learner checks the others when it is built."""


def misfit_of(key: str, value: Any) -> str:
    """Return the reason why an argument cannot have a value, "" if it can as far as is known here.

    Args:
        key: name of the argument.
        value: value to check.
    """
    if key not in KINDS:
        return ""
    try:
        TypeAdapter(KINDS[key]).validate_python(value)
    except ValidationError as error:
        first = error.errors()[0]
        place = "".join(f"[{part}]" for part in first["loc"])
        return f"{place}: {reason_of(first, ())}" if place else reason_of(first, ())
    return ""
