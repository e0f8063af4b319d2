"""Reading of training folders for `onedemo curves`, with a distinct label for each training."""

from __future__ import annotations

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path
from typing import Any, NamedTuple

from pydantic import ValidationError

from ...configs import BadConfig, TrainConfig
from ...configs.learner_arguments import DEFAULTS
from ...configs.train_config import BESIDE
from ..method_table import place_of
from ..train.curve_figure import Curves
from ..train.folder import CONFIG, curve_of, seeds_of


class Training(NamedTuple):
    """Curves of a training.

    Attributes:
        folder: folder of the training.
        config: its config.
        curves: evaluations of each seed that has any.
    """

    folder: Path
    config: TrainConfig
    curves: Curves

    @property
    def setting(self) -> tuple[str, str, str]:
        """Task, robot and level."""
        return self.config.task, self.config.robot, self.config.level


def read_training(folder: Path) -> Training:
    """Read the config of a training's folder and the evaluations of its seeds so far, possibly none.

    Raises:
        BadConfig: the folder holds no training, or a seed's state is damaged.
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
    """Return the trainings by label, in the order of tables.

    A label is the algorithm and, for several trainings of one algorithm, the settings that differ.
    """
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
    """Return all settings that determine a seed's curve, defaults included, by dotted key."""
    values = config.model_dump(mode="json", exclude={*BESIDE, "env", "learner"})
    learner = {**DEFAULTS[config.algorithm], **config.learner}
    return {
        **values,
        **{f"env.{key}": value for key, value in config.env.items()},
        **{f"learner.{key}": value for key, value in learner.items()},
    }
