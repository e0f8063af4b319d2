"""Schema of benchmark configs: one cell of a comparison, and how all cells are run."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from functools import lru_cache
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    SerializerFunctionWrapHandler,
    field_validator,
    model_serializer,
    model_validator,
)

from .errors import unknown_key

STRICT = ConfigDict(extra="forbid", frozen=True, strict=True)
Name = Annotated[str, Field(pattern=r"^[A-Za-z0-9][A-Za-z0-9_-]{0,63}$")]
Values = Annotated[list[Any], Field(min_length=1, max_length=1000)]
Meters = Annotated[float, Field(ge=-1, le=1)]
Degrees = Annotated[float, Field(ge=-360, le=360)]
Condition = Annotated[dict[str, Any], Field(min_length=1)]
BESIDE = ("name", "video", "trajectories", "episodes")
"""Keys that do not affect the course of an episode."""
IMPLIED: dict[str, dict[str, Any]] = {"S": {"key_poses": 6}, "T": {"tool": (0.1, 0.0, 0.0, 90.0)}}
"""Values implied by a level where the cell gives none."""
FAMILIES: dict[str, dict[str, str]] = {"robosuite": {"task": "Lift", "range": "D0"}}
"""Environments that are several tasks: the arguments that tell which, with their defaults."""
RENAMED_METHODS = {"screw-no-repet": "screw-guard-only"}
"""Present names of methods by former ones, which are read everywhere; digests and hashes stay those of former names."""
LATER = ("key_poses", "tool", "contents", "clock", "delay")
"""Keys that are written, and part of the digest, only if they have another value than their default."""
WAITS, REAL = "waits", "real"
"""Clocks of an episode, see `RunConfig.clock`."""


def present_method(name: str) -> str:
    """Return the present name of a method."""
    return RENAMED_METHODS.get(name, name)


def first_method(name: str) -> str:
    """Return the name that a method had first, by which digests and hashes know it."""
    return {present: former for former, present in RENAMED_METHODS.items()}.get(name, name)


def digest_of(value: Any) -> str:
    """Return twelve hexadecimal digits of the hash of any JSON value."""
    text = json.dumps(value, sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(text.encode()).hexdigest()[:12]


class RunConfig(BaseModel):
    """One method on one task at one level: a cell.

    Attributes:
        name: first part of the run folder's name.
        task: name of the task, like "stack".
        method: name of the policy, like "screw".
        demonstration: name of a shipped demonstration, or a file.
        episodes: number of scenarios.
        level: difficulty: how far scenarios differ from the demonstration.
        robot: robosuite's name of the robot.
        seed: seed of the first scenario; scenario k has the seed `seed + k`.
        obstacles: kind of obstacles; None: that of the level.
        key_poses: number of key poses per segment of the demonstration given to the method; None: all poses, at level S
            6.
        tool: x, y, z [m] and turn about z [deg], in the tcp frame, of another frame in which the method moves the hand;
            None: the tcp frame itself, at level T [0.1, 0, 0, 90].
        env: further arguments of the environment, like `n_blocks` of stacking.
        max_seconds: simulated time limit of an episode [s]; None: that of the task.
        clock: "waits": the world waits while the policy computes; "real": it goes on, one held control step for each
            control period that a call's CPU time takes beyond its own one. Then results depend on the machine.
        delay: number of control steps by which every observation is late; the first one is repeated until then.
        video: whether to make videos: of the first failure of each kind, and of the first episode of a single cell.
        trajectories: whether to keep the measurements of every tick, one .npz per episode.
        settings: settings of the method, with its own keys.
        contents: first digits of the SHA-256 of the files of one's own that decide: demonstration, what is said of its
            skill, modules; found when the cell is run, and demanded if it is written; None: there are none.
    """

    model_config = STRICT

    name: Name
    task: str
    method: str = "screw"
    demonstration: str
    episodes: Annotated[int, Field(ge=1, le=1_000_000)] = 10
    level: str = "L1"
    robot: str = "Panda"
    seed: Annotated[int, Field(ge=0, le=2**31)] = 0
    obstacles: str | None = None
    key_poses: Annotated[int, Field(ge=2, le=10_000)] | None = None
    tool: Annotated[tuple[Meters, Meters, Meters, Degrees], Field(strict=False)] | None = None
    env: dict[str, Any] = Field(default_factory=dict)
    max_seconds: Annotated[float, Field(gt=0, le=3600)] | None = None
    clock: Literal["waits", "real"] = WAITS
    delay: Annotated[int, Field(ge=0, le=1000)] = 0
    video: bool = True
    trajectories: bool = False
    settings: dict[str, Any] = Field(default_factory=dict)
    contents: Annotated[str, Field(pattern="^[0-9a-f]{12}$")] | None = None

    @field_validator("method")
    @classmethod
    def _with_its_present_name(cls, method: str) -> str:
        return present_method(method)

    @model_validator(mode="before")
    @classmethod
    def _with_what_the_level_implies(cls, values: Any) -> Any:
        level = values.get("level") if isinstance(values, dict) else None
        implied = IMPLIED.get(level, {}) if isinstance(level, str) else {}
        return {**values, **{key: value for key, value in implied.items() if values.get(key) is None}}

    @model_serializer(mode="wrap")
    def _without_what_is_not_asked_for(self, written: SerializerFunctionWrapHandler) -> dict[str, Any]:
        # a cell without these keys keeps the digest it had before they were introduced
        later = {key: type(self).model_fields[key].default for key in LATER}
        return {key: value for key, value in written(self).items() if key not in later or value != later[key]}

    @property
    def condition(self) -> str:
        """Level, number of key poses if limited, tool unless the level implies it, clock and delay, like "S 6"."""
        implied = IMPLIED.get(self.level, {})
        words = [self.level]
        if self.key_poses is not None:
            words.append(f"{self.key_poses}" if "key_poses" in implied else f"{self.key_poses} key poses")
        if self.tool is not None and self.tool != implied.get("tool"):
            words.append("tool " + " ".join(f"{value:g}" for value in self.tool))
        words += ["real clock"] if self.clock == REAL else []
        words += [f"delay {self.delay}"] if self.delay else []
        return " ".join(words)

    @property
    def task_words(self) -> str:
        """Name of the task in tables; of one of several in an environment what tells it apart: "Stack D1"."""
        apart = FAMILIES.get(self.task, {})
        return " ".join(str(self.env.get(key, default)) for key, default in apart.items()) or self.task

    def digest(self) -> str:
        """Return twelve hexadecimal digits of all values that affect the course of an episode: all but `BESIDE`."""
        values = self.model_dump(mode="json", exclude=set(BESIDE))
        return digest_of({**values, "method": first_method(self.method)})


class Default(BaseModel):
    """Values for some cells, unless they are set elsewhere.

    Attributes:
        when: required values of a cell's keys, one or a list of alternatives each; dotted keys reach into mappings.
        set: values of a cell's keys; mappings are merged.
    """

    model_config = STRICT

    when: Condition
    set: Annotated[dict[str, Any], Field(min_length=1)]


class RunSettings(BaseModel):
    """Keys of a config besides those of a cell.

    Attributes:
        sweep: list of values per key; there is a cell for each combination, the first key varying slowest.
        defaults: values for some of the cells; weaker than values set elsewhere, later ones stronger than earlier ones.
        exclude: conditions of excluded combinations.
        executor: where episodes run: in this process, in worker processes, or in Ray's actors.
        workers: number of workers; None: one per processor core.
        address: address of a Ray cluster; None: a local one.
        wall_seconds: real time [s] after which an episode's worker counts as hung.
    """

    model_config = STRICT

    sweep: dict[str, Values] = Field(default_factory=dict)
    defaults: list[Default] = Field(default_factory=list)
    exclude: list[Condition] = Field(default_factory=list)
    executor: Literal["serial", "process", "ray"] = "process"
    workers: Annotated[int, Field(ge=1, le=1024)] | None = None
    address: str | None = None
    wall_seconds: Annotated[float, Field(gt=0, le=86_400)] = 600.0


CELL_KEYS = tuple(RunConfig.model_fields)
SWITCHES = tuple(key for key, field in RunConfig.model_fields.items() if field.annotation is bool)
RUN_KEYS = tuple(RunSettings.model_fields)


def cell_of(values: Mapping[str, Any]) -> RunConfig:
    """Return the cell of a mapping as `model_dump(mode="json")` gives it, validated once per process."""
    return _cell_of(json.dumps(values, sort_keys=True))


@lru_cache(maxsize=1024)
def _cell_of(text: str) -> RunConfig:
    return RunConfig.model_validate(json.loads(text))


def json_schema() -> dict[str, Any]:
    """Return the JSON schema of a config file, for editors."""
    cell, run = RunConfig.model_json_schema(), RunSettings.model_json_schema()
    return {
        "$schema": "https://json-schema.org/draft/2020-12/schema",
        "title": "OneDemo benchmark config",
        "description": "Keys of a cell, which hold for all cells, and how the cells are made and run.",
        "type": "object",
        "properties": {**cell["properties"], **run["properties"]},
        "required": ["name"],
        "additionalProperties": False,
        "$defs": {**cell.get("$defs", {}), **run.get("$defs", {})},
    }


def reason_of(error: Any, allowed: tuple[str, ...]) -> str:
    """Return the message for one of pydantic's errors, in the project's words.

    Args:
        error: pydantic's error, as a mapping.
        allowed: allowed keys, for an unknown key.
    """
    if error["type"] == "extra_forbidden":
        return unknown_key(str(error["loc"][-1]), allowed)
    if error["type"] == "missing":
        return "is missing"
    return f"{worded(error)}, got {error['input']!r}"


def worded(error: Any) -> str:
    """Return what one of pydantic's errors says, without pydantic's own words before it.

    Args:
        error: pydantic's error, as a mapping.
    """
    cause = error.get("ctx", {}).get("error")
    return str(cause) if cause is not None else f"{error['msg'][0].lower()}{error['msg'][1:]}"
