"""Allowed values of common learner arguments; the learner checks the others when it is built."""

from __future__ import annotations

from typing import Annotated, Any

from pydantic import Field, TypeAdapter, ValidationError

from .run_config import reason_of

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
