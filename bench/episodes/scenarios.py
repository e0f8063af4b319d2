"""The frozen starts of a run: drawn once, hashed, and equal for every method."""

from __future__ import annotations

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from ...configs import BadConfig, RunConfig
from ...planner.errors import OneDemoError
from ..atomic_files import canonical, sha256_of, write_whole
from ..console import counted

FILE = "scenarios.json"
VERSION = 1
SCENE_KEYS = ("task", "robot", "level", "obstacles", "env", "seed")
"""Keys of a cell that determine its scenarios."""
POLICY_KEYS = ("control_mode", "reward")
"""Arguments of environments that change actions or rewards but not the start: methods that differ only in them share
their scenarios, and are paired."""


class ScenarioChanged(OneDemoError):
    """The environment draws another start than the frozen one."""

    def __init__(self, index: int, seed: int, difference: str):
        self.index, self.seed, self.difference = index, seed, difference
        super().__init__(
            f"{FILE}: scenario {index} (seed {seed}): {difference}: the environment is not the one that these were "
            "drawn from; choose another --output"
        )


@dataclass(frozen=True, slots=True)
class Scenario:
    """One start of one task; the environment draws everything else from the seed.

    Attributes:
        index: position in the list.
        seed: seed for `env.reset`.
        level: level for `env.reset`.
    """

    index: int
    seed: int
    level: str


def scenarios_of(config: RunConfig) -> list[Scenario]:
    """Return the scenarios of a config."""
    return [Scenario(k, config.seed + k, config.level) for k in range(config.episodes)]


def place_of(config: RunConfig) -> str:
    """Return the scenario key of a cell as JSON text: cells with equal keys share their scenarios and are paired."""
    return canonical(_place({key: getattr(config, key) for key in SCENE_KEYS}))


def lists_of(cells: Iterable[RunConfig]) -> list[RunConfig]:
    """Return the cell with the most episodes for each scenario key, sorted by key."""
    longest: dict[str, RunConfig] = {}
    for cell in cells:
        place = place_of(cell)
        if place not in longest or cell.episodes > longest[place].episodes:
            longest[place] = cell
    return [longest[place] for place in sorted(longest)]


def frozen(config: RunConfig, index: int, drawn: Mapping[str, Any]) -> dict[str, Any]:
    """Return a scenario as written in the file, with its fingerprint.

    Args:
        config: a cell with the scenario's key.
        index: position in the list.
        drawn: the start, see `start_states.drawn_start`; or the reason why there is none, under "infeasible".
    """
    place = {**json.loads(place_of(config)), "seed": config.seed + index, "index": index, **drawn}
    return {**place, "fingerprint": sha256_of(place)[:12]}


class Suite:
    """All scenarios of a run.

    Attributes:
        scenarios: scenarios as in the file.
        hash: sha256 of their canonical JSON.
    """

    def __init__(self, scenarios: Sequence[Mapping[str, Any]]):
        self.scenarios = list(scenarios)
        self.hash = sha256_of(self.scenarios)
        self._at = {_key(each, each["seed"] - each["index"], each["index"]): each for each in self.scenarios}

    def of(self, config: RunConfig, index: int) -> Mapping[str, Any]:
        """Return the scenario of a cell by index.

        Args:
            config: the cell.
            index: position in the cell's list.
        """
        values = {key: getattr(config, key) for key in SCENE_KEYS}
        return self._at[_key(values, config.seed, index)]

    def feasible(self, config: RunConfig) -> list[Scenario]:
        """Return the scenarios of a cell that can be run."""
        return [each for each in scenarios_of(config) if "infeasible" not in self.of(config, each.index)]

    def summary(self) -> str:
        """Return the numbers of scenarios, refused draws and infeasible scenarios in words."""
        refused = sum(each.get("refused", 0) for each in self.scenarios)
        infeasible = sum("infeasible" in each for each in self.scenarios)
        count = len(self.scenarios)
        parts = [f"{counted(count, 'scenario')}, suite {self.hash[:12]}"]
        if refused:
            parts.append(f"{refused} of {count + refused} draws had no room for the obstacles and were drawn anew")
        if infeasible:
            parts.append(f"{infeasible} could not be drawn at all and are left out")
        return "; ".join(parts)

    def write(self, folder: Path) -> None:
        """Write the scenarios into a run folder."""
        head = f'{{"version": {VERSION}, "suite": "{self.hash}", "scenarios": [\n'
        write_whole(folder / FILE, head + ",\n".join(canonical(each) for each in self.scenarios) + "\n]}\n")


def _key(values: Mapping[str, Any], seed: int, index: int) -> tuple[str, int]:
    return canonical({**_place(values), "seed": seed}), index


def _place(values: Mapping[str, Any]) -> dict[str, Any]:
    place = {key: values[key] for key in SCENE_KEYS}
    return {**place, "env": {key: value for key, value in place["env"].items() if key not in POLICY_KEYS}}


def read_suite(folder: Path) -> Suite | None:
    """Return the scenarios of a run folder; None if they have not been drawn yet.

    Raises:
        BadConfig: the file is invalid, of another version, or was changed.
    """
    file = folder / FILE
    if not file.is_file():
        return None
    try:
        values = json.loads(file.read_text(encoding="utf-8"))
        if values["version"] != VERSION:
            raise BadConfig(file, "version", f"is {values['version']!r}; known: {VERSION}")
        suite = Suite(values["scenarios"])
    except (ValueError, TypeError, KeyError) as error:
        if isinstance(error, BadConfig):
            raise
        raise BadConfig(file, "", f"is not a list of scenarios: {type(error).__name__} {error}") from None
    if suite.hash != values.get("suite"):
        raise BadConfig(file, "suite", "is not the hash of the scenarios: the file has been changed")
    return suite


def check_mergeable(suites: Mapping[Path, Suite]) -> None:
    """Refuse to compare runs of different scenarios.

    Raises:
        BadConfig: the hashes differ; the error names two of the folders.
    """
    (first, kept), *others = suites.items()
    for folder, suite in others:
        if suite.hash != kept.hash:
            reason = f"{suite.hash[:12]} is not the suite of {first} ({kept.hash[:12]}): they cannot be compared"
            raise BadConfig(folder / FILE, "suite", reason)
