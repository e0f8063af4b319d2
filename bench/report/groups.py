"""Comparison of methods: groups of episodes, rates with intervals, and tests of pairs with equal starts."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from ...configs import RunConfig
from ...configs.dotted_keys import leaves
from ...configs.run_config import BESIDE, LATER
from ...envs import TASKS
from ..document.untrusted_text import plain
from ..episodes.episode_records import EpisodeRecord
from ..episodes.scenarios import place_of as drawn_from
from ..method_table import REFERENCE, place_of
from ..metrics.metric_table import METRICS, Metric
from ..statistics import FEWEST, Difference, Rate, holm, mcnemar, only_one, paired_bootstrap
from ..workers.dispatcher import HUNG
from .read_runs import Run

ORDERED = ("L0", "L1", "L2", "L3", "L4")
"""Levels in order of difficulty."""
LONGEST_CHANGES = 40
"""Largest number of characters of the settings in a label."""
SAFE, UNSAFE = "safe success", "unsafe success"
"""The two outcomes that are not failures."""


class Setting(NamedTuple):
    """Common conditions of compared methods; the level includes further conditions, see `RunConfig.condition`."""

    task: str
    robot: str
    level: str


@dataclass(frozen=True)
class Group:
    """The episodes of one cell.

    Attributes:
        label: the method, with the settings that distinguish it from others of the same method.
        cell: config of the cell.
        planned: number of planned episodes.
        records: finished episodes, by index.
    """

    label: str
    cell: RunConfig
    planned: int
    records: list[EpisodeRecord]

    @property
    def setting(self) -> Setting:
        """Conditions on which the group is compared with others."""
        return _setting(self.cell)

    @property
    def place(self) -> str:
        """Place on the axis of a figure: the level; of one of several tasks in an environment also the task."""
        task, _, level = self.setting
        return level if task == self.cell.task else f"{task} {level}"

    @cached_property
    def success(self) -> Rate:
        """Rate of successes."""
        return Rate.of(sum(record.success for record in self.records), len(self.records))

    @cached_property
    def safe_success(self) -> Rate:
        """Rate of successes without any unwanted contact."""
        return Rate.of(sum(record.safe_success for record in self.records), len(self.records))

    @cached_property
    def outcomes(self) -> Counter[str]:
        """Number of episodes by outcome: `SAFE`, `UNSAFE`, or the reason of the failure."""
        return Counter(outcome_of(record) for record in self.records)

    def values(self, name: str) -> np.ndarray:
        """Return the known values of a metric (n,); if the metric is for successes only, those of successes."""
        only = METRICS[name].successes
        found = (record.metrics.get(name) for record in self.records if record.success or not only)
        return np.array([value for value in found if value is not None], dtype=np.float64)


def outcome_of(record: EpisodeRecord) -> str:
    """Return the outcome of an episode: `SAFE`, `UNSAFE`, or the reason of the failure."""
    if record.success:
        return SAFE if record.safe else UNSAFE
    # the task's own "timeout" refers to simulated time
    if record.lost and record.failure_reason == HUNG:
        return "hung"
    return record.failure_reason or "unknown"


def groups_of(run: Run) -> list[Group]:
    """Return all cells as groups in the order of tables: task, robot, level, method.

    Labels distinguish cells of one method on the same setting by the keys in which they differ, else by their digests.
    """
    alike: dict[tuple[Setting, str], list[RunConfig]] = {}
    for cell in run.cells.values():
        alike.setdefault((_setting(cell), cell.method), []).append(cell)
    words = {digest: _differing(cell, alike[_setting(cell), cell.method]) for digest, cell in run.cells.items()}
    same = Counter((_setting(cell), cell.method, words[digest]) for digest, cell in run.cells.items())
    found = []
    for digest, cell in run.cells.items():
        twice = same[_setting(cell), cell.method, words[digest]] > 1
        label = " ".join(filter(None, (cell.method, words[digest], f"({digest[:4]})" if twice else "")))
        found.append(Group(label, cell, run.planned(digest), run.records.get(digest, [])))
    return sorted(
        found, key=lambda group: (*place_of_setting(group.setting), *place_of(group.cell.method), group.label)
    )


def _setting(cell: RunConfig) -> Setting:
    return Setting(cell.task_words, cell.robot, cell.condition)


def _differing(cell: RunConfig, others: list[RunConfig]) -> str:
    """Return in one line the keys and values that distinguish a cell, as on the command line; "" if there are none."""
    written = [_written(each) for each in others]
    own = _written(cell)
    parts = [f"{key}={value}" for key, value in own.items() if any(each.get(key, own) != value for each in written)]
    return plain(" ".join(parts), LONGEST_CHANGES)


def _written(cell: RunConfig) -> dict[str, Any]:
    """Return the values that determine the episodes, by dotted keys; keys of settings without their common prefix."""
    values = cell.model_dump(mode="json", exclude={*BESIDE, *LATER, "settings"}, exclude_defaults=True)
    settings = {key: value for key, value in cell.settings.items() if key != "training_steps"}
    return dict(sorted([*leaves(values), *leaves(settings)]))


def groups_by_task(groups: list[Group]) -> dict[tuple[str, str], list[Group]]:
    """Return the groups by task and robot."""
    return _split(groups, lambda group: group.setting[:2])


def groups_by_environment(groups: list[Group]) -> dict[tuple[str, str], list[Group]]:
    """Return the groups by environment, which may have several tasks, and robot."""
    return _split(groups, lambda group: (group.cell.task, group.cell.robot))


def _split(groups: list[Group], key: Callable[[Group], tuple[str, str]]) -> dict[tuple[str, str], list[Group]]:
    found: dict[tuple[str, str], list[Group]] = {}
    for group in groups:
        found.setdefault(key(group), []).append(group)
    return found


def place_of_setting(setting: Setting) -> tuple[int | str, ...]:
    """Return the sorting key of a setting."""
    tasks = list(TASKS)
    task = tasks.index(setting.task) if setting.task in tasks else len(tasks)
    return (task, setting.task, setting.robot, *rank(setting.level))


def rank(level: str) -> tuple[int, str, int, str]:
    """Return the sorting key of a level; more key poses come first."""
    name, _, rest = level.partition(" ")
    count = re.match(r"\d+", rest)
    place = ORDERED.index(name) if name in ORDERED else len(ORDERED)
    return place, name, -int(count[0]) if count else 0, rest


@dataclass(frozen=True, slots=True)
class SuccessTest:
    """Paired test of success of two methods on the same scenarios.

    Attributes:
        setting: common conditions.
        label: label of the method compared with the reference.
        pairs: number of scenarios run by both.
        only_reference: number of pairs in which only the reference succeeded.
        only_other: number of pairs in which only the other method succeeded.
        p: McNemar's p-value.
        adjusted: p-value after Holm's correction over all tests of the method.
    """

    setting: Setting
    label: str
    pairs: int
    only_reference: int
    only_other: int
    p: float
    adjusted: float


@dataclass(frozen=True, slots=True)
class MetricTest:
    """Paired test of a metric of two methods on the same scenarios.

    Attributes:
        setting: common conditions.
        label: label of the method compared with the reference.
        name: name of the metric.
        difference: reference minus the other method, in the metric's printed unit.
        adjusted: p-value after Holm's correction over all tests of the method and the metric.
    """

    setting: Setting
    label: str
    name: str
    difference: Difference
    adjusted: float

    @property
    def metric(self) -> Metric:
        """The compared metric."""
        return METRICS[self.name]


def success_tests(groups: list[Group], succeeded: Callable[[EpisodeRecord], bool]) -> list[SuccessTest]:
    """Return the tests of every method against the reference where both ran the same scenarios.

    Args:
        groups: groups of the run.
        succeeded: verdict on an episode, like success or safe success.
    """
    found = []
    for reference, other in _opponents(groups):
        pairs = [(succeeded(a), succeeded(b)) for a, b in _paired(reference, other)]
        ours, theirs = only_one(pairs)
        found.append(SuccessTest(other.setting, other.label, len(pairs), ours, theirs, mcnemar(ours, theirs), 1.0))
    adjusted = _adjusted([(test.label, test.p) for test in found])
    return [
        SuccessTest(t.setting, t.label, t.pairs, t.only_reference, t.only_other, t.p, q)
        for t, q in zip(found, adjusted, strict=True)
    ]


def metric_tests(groups: list[Group]) -> list[MetricTest]:
    """Return the tests of every paired metric of every method against the reference, given at least `FEWEST` pairs."""
    found: list[tuple[Setting, str, str, Difference]] = []
    for reference, other in _opponents(groups):
        pairs = _paired(reference, other)
        for name, metric in METRICS.items():
            values = [
                (a.metrics.get(name), b.metrics.get(name))
                for a, b in pairs
                if (a.success and b.success) or not metric.successes
            ]
            known = np.array([pair for pair in values if None not in pair], dtype=np.float64).reshape(-1, 2)
            if metric.paired and len(known) >= FEWEST:
                difference = paired_bootstrap(*(metric.factor * known.T))
                found.append((other.setting, other.label, name, difference))
    adjusted = _adjusted([(f"{label} {name}", difference.p) for _, label, name, difference in found])
    return [MetricTest(*test, q) for test, q in zip(found, adjusted, strict=True)]


def _opponents(groups: list[Group]) -> list[tuple[Group, Group]]:
    """Return the reference with each other method on scenarios of the same key and with the same conditions."""
    found = []
    for place in dict.fromkeys((drawn_from(group.cell), group.setting) for group in groups):
        here = [group for group in groups if (drawn_from(group.cell), group.setting) == place]
        ours = sorted((g for g in here if g.cell.method == REFERENCE), key=lambda g: len(g.cell.settings))
        found += [(ours[0], group) for group in here if ours and group is not ours[0]]
    return found


def _paired(first: Group, second: Group) -> list[tuple[EpisodeRecord, EpisodeRecord]]:
    known = {record.scenario: record for record in second.records}
    keys = [(record, known.get(record.scenario)) for record in first.records]
    return [(a, b) for a, b in keys if b is not None]


def _adjusted(tests: list[tuple[str, float]]) -> list[float]:
    """Return Holm's p-values within each family; tests name their family."""
    out = [float("nan")] * len(tests)
    for family in {name for name, _ in tests}:
        places = [k for k, (name, _) in enumerate(tests) if name == family]
        for k, value in zip(places, holm([tests[k][1] for k in places]), strict=True):
            out[k] = value
    return out
