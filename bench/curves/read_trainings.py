"""Folders of trainings as `onedemo curves` reads them: the curves of each, and a name that tells it from the others."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from ...configs.learner_defaults import DEFAULTS
from ...configs.train_config import BESIDE, TrainConfig
from ...planner.errors import BadConfig
from ..train.curve_figure import Curves
from ..method_table import place_of
from ..train.folder import CONFIG, curve_of, seeds_of


class Training(NamedTuple):
    """What a training has come to.

    Attributes:
        folder: of it.
        config: of it.
        curves: the evaluations of each seed that has any.
    """

    folder: Path
    config: TrainConfig
    curves: Curves

    @property
    def setting(self) -> tuple[str, str, str]:
        """Task, robot and level."""
        return self.config.task, self.config.robot, self.config.level


def read_training(folder: Path) -> Training:
    """The config of a training's folder, and the evaluations of its seeds so far, perhaps none.

    Raises:
        BadConfig: it is none.
    """
    file = folder / CONFIG
    if not file.is_file():
        why = f"has no {CONFIG}" if folder.is_dir() else "there is no such folder"
        raise BadConfig(folder, "", f"{why}; give folders that onedemo train has made")
    try:
        config = TrainConfig.model_validate(json.loads(file.read_text(encoding="utf-8")))
    except (OSError, ValueError, ValidationError):
        raise BadConfig(file, "", "is not a training's; give folders that onedemo train has made") from None
    return Training(folder, config, [points for seed in seeds_of(config) if (points := curve_of(folder, seed))])


def by_label(trainings: Sequence[Training]) -> dict[str, Training]:
    """By algorithm, in the order of tables; where there are several of one, by what differs, too."""
    trainings = sorted(trainings, key=lambda each: place_of(each.config.algorithm))
    labels = []
    for each in trainings:
        same = [flat(other.config) for other in trainings if other.config.algorithm == each.config.algorithm]
        values = flat(each.config)
        differing = [key for key in values if any(other.get(key) != values[key] for other in same)]
        words = [f"{key.rpartition('.')[-1]} {values[key]}" for key in differing]
        labels.append(", ".join([each.config.algorithm, *words]))
    twice = Counter(labels)
    return {
        label if twice[label] == 1 else f"{label} ({each.folder})": each
        for label, each in zip(labels, trainings, strict=True)
    }


def flat(config: TrainConfig) -> dict[str, Any]:
    """All that decides how a seed's curve goes, with defaults, by dotted key."""
    values = config.model_dump(mode="json", exclude={*BESIDE, "env", "learner"})
    learner = {**DEFAULTS[config.algorithm], **config.learner}
    return {
        **values,
        **{f"env.{key}": value for key, value in config.env.items()},
        **{f"learner.{key}": value for key, value in learner.items()},
    }
