"""Which episodes a run consists of: a list that depends on the config alone, the same for every method."""

from __future__ import annotations

from dataclasses import dataclass

from ..configs.schema import RunConfig


@dataclass(frozen=True, slots=True)
class Scenario:
    """One start of one task; the environment draws everything else from the seed.

    Attributes:
        index: position in the list.
        seed: given to `env.reset`.
        level: given to `env.reset`.
    """

    index: int
    seed: int
    level: str


def scenarios_of(config: RunConfig) -> list[Scenario]:
    """The scenarios of a config."""
    return [Scenario(k, config.seed + k, config.level) for k in range(config.episodes)]
