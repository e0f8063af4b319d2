"""Tables of a report."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable

import numpy as np

from ..document.document import Entry, Link, Table
from ..episodes.episode_records import EpisodeRecord
from ..episodes.failure_selection import Video
from ..episodes.world_clock import SLOW
from ..method_table import ACTOR_KEYS, REFERENCE, STEPS_KEYS, WITHOUT_DEMONSTRATION, place_of
from ..metrics.metric_table import METRICS
from ..statistics import Rate, interquartile_mean, median
from .groups import SAFE, UNSAFE, Group, MetricTest, Setting, SuccessTest, groups_by_task, outcome_of
from .outcome_figures import OUTCOMES
from .rate_figures import series_of

NOTHING = "–"
MANY = 20
"""Number of rows above which a table is collapsed."""


def settings_of(groups: list[Group]) -> dict[Setting, str]:
    """Return the settings with their names; the names omit the robot if there is only one."""
    robots = {group.setting.robot for group in groups}
    names = {group.setting: f"{group.setting.task} {group.setting.level}" for group in groups}
    return {key: name if len(robots) == 1 else f"{name} {key.robot}" for key, name in names.items()}


def labels_of(groups: list[Group]) -> list[str]:
    """Return the labels of all methods in their order."""
    return [line.label for line in series_of(groups)]


def headline(groups: list[Group], rate: Callable[[Group], Rate]) -> Table:
    """Return a table of a rate of every cell: one row per setting, one column per method.

    Args:
        groups: groups of the run.
        rate: the rate of a group.
    """
    labels, known = labels_of(groups), {(group.setting, group.label): group for group in groups}
    rows: list[list[Entry]] = []
    for setting, name in settings_of(groups).items():
        here = [known.get((setting, label)) for label in labels]
        counts = sorted({len(group.records) for group in here if group is not None})
        entries: list[Entry] = [NOTHING if group is None else rate(group) for group in here]
        rows.append([name, "–".join(map(str, dict.fromkeys((counts[0], counts[-1])))), *entries])
    return Table(["setting", "n", *labels], rows, 1)


def counts(groups: list[Group]) -> Table:
    """Return a table of counts of every cell: episodes, successes, contacts, refused starts, and failures by reason."""
    names = settings_of(groups)
    reasons = [o for o in outcomes_of(groups) if o not in (SAFE, UNSAFE)]
    rows: list[list[Entry]] = []
    for group in groups:
        done = f"{len(group.records)}" + (f" of {group.planned}" if len(group.records) < group.planned else "")
        touching = sum(record.contacts > 0 for record in group.records)
        refused = sum(record.refused for record in group.records)
        numbers = [str(value) for value in (group.safe_success.count, group.success.count, touching, refused)]
        rows.append([names[group.setting], group.label, done, *numbers, *(str(group.outcomes[o]) for o in reasons)])
    head = [
        "setting",
        "method",
        "episodes",
        "safe successes",
        "successes",
        "touching an obstacle",
        "refused starts",
        *map(words_of, reasons),
    ]
    return Table(head, rows, 2, "Counts of every cell")


def success_tests(groups: list[Group], tests: list[SuccessTest]) -> Table:
    """Return a table of wins in pairs (reference only : method only) and Holm's p per setting and method.

    Args:
        groups: groups of the run.
        tests: tests of success.
    """
    known = {(test.setting, test.label): test for test in tests}
    labels = [label for label in labels_of(groups) if any(test.label == label for test in tests)]
    rows: list[list[Entry]] = []
    for setting, name in settings_of(groups).items():
        here = [known.get((setting, label)) for label in labels]
        if any(here):
            entries = [
                NOTHING if test is None else f"{test.only_reference} : {test.only_other}, p {p_words(test.adjusted)}"
                for test in here
            ]
            rows.append([name, str(max(test.pairs for test in here if test)), *entries])
    return Table(["setting", "pairs", *labels], rows, 1)


def metric_tests(groups: list[Group], tests: list[MetricTest]) -> Table:
    """Return a table of paired differences of metrics.

    Args:
        groups: groups of the run.
        tests: tests of metrics.
    """
    names = settings_of(groups)
    rows: list[list[Entry]] = []
    for test in tests:
        mean, low, high, p, pairs = test.difference
        words = [f"{number(mean)} [{number(low)}, {number(high)}]", p_words(p), p_words(test.adjusted)]
        rows.append([names[test.setting], test.label, test.metric.title, str(pairs), *words])
    head = ["setting", "method", "metric", "pairs", f"{REFERENCE} less the method", "p", "p (Holm)"]
    return Table(head, rows, 3, "Paired differences of metrics")


def metrics(groups: list[Group], names: list[str], title: str = "") -> Table:
    """Return a table of interquartile means of some metrics.

    Args:
        groups: groups of one task, or of all in one environment.
        names: names of the metrics.
        title: title of a collapsed table; "": always shown.
    """
    settings, rows = settings_of(groups), []
    for group in groups:
        values = [(METRICS[name].factor, group.values(name)) for name in names]
        means = [number(factor * interquartile_mean(known)) if len(known) else NOTHING for factor, known in values]
        rows.append([settings[group.setting], group.label, *means])
    return Table(["setting", "method", *(METRICS[name].title for name in names)], rows, 2, title)


def known_metrics(groups: list[Group]) -> list[str]:
    """Return the names of the metrics that have a value in any episode."""
    return [name for name in METRICS if any(len(group.values(name)) for group in groups)]


def failures(groups: list[Group], videos: list[Video]) -> Table:
    """Return a table of the first failure of each kind of each method, preferring failures with a video.

    Args:
        groups: groups of the run.
        videos: videos of failures.
    """
    shown = {(video.cell, video.index): video for video in videos}
    names, total = settings_of(groups), Counter((g.label, o) for g in groups for o in g.outcomes.elements())
    rows: dict[tuple[str, str], list[Entry]] = {}
    for group in groups:
        for record in group.records:
            key = (group.label, outcome_of(record))
            filmed = (record.cell, record.index) in shown
            if not record.success and (key not in rows or (filmed and not isinstance(rows[key][-2], Link))):
                video = shown.get((record.cell, record.index))
                link = Link("video", video.file) if video else NOTHING
                words = [words_of(key[1]), names[group.setting], record.stage, record.detail]
                rows[key] = [group.label, *words, str(record.seed), link, str(total[key])]
    order = [(label, outcome) for label in labels_of(groups) for outcome in outcomes_of(groups)]
    head = ["method", "failure", "setting", "stage", "explanation", "seed", "video", "how many"]
    found = [rows[key] for key in order if key in rows]
    return Table(head, found, 5, "The first failure of each kind of each method" if len(found) > MANY else "")


def every_failure(groups: list[Group], videos: list[Video]) -> Table:
    """Return a table of all failures.

    Args:
        groups: the groups, typically of one cell.
        videos: videos of failures.
    """
    shown = {(video.cell, video.index): video for video in videos}
    rows: list[list[Entry]] = []
    for group in groups:
        for record in group.records:
            if not record.success:
                video = shown.get((record.cell, record.index))
                link = Link("video", video.file) if video else NOTHING
                words = [words_of(outcome_of(record)), record.stage, record.detail]
                rows.append([*words, str(record.index), str(record.seed), link])
    return Table(["failure", "stage", "explanation", "scenario", "seed", "video"], rows, 3, "Every failure")


def unsafe_successes(groups: list[Group]) -> Table:
    """Return a table of the first unwanted contact of each kind in successes of each method."""
    rows: dict[tuple[str, str], list[Entry]] = {}
    total = Counter((g.label, r.collision) for g in groups for r in g.records if outcome_of(r) == UNSAFE)
    for group in groups:
        for record in group.records:
            key = (group.label, record.collision)
            if outcome_of(record) == UNSAFE and key not in rows:
                rows[key] = [group.label, record.collision, str(record.seed), str(total[key])]
    return Table(["method", "contact", "seed", "how many"], list(rows.values()), 2, "Contacts in successes")


def outcomes_of(groups: list[Group]) -> list[str]:
    """Return all outcomes that occur, in the order of figures."""
    found = {outcome for group in groups for outcome in group.outcomes}
    return [*(o for o in OUTCOMES if o in found), *sorted(found - set(OUTCOMES))]


def words_of(outcome: str) -> str:
    """Return an outcome in words."""
    return OUTCOMES[outcome][2] if outcome in OUTCOMES else outcome


def timing(groups: list[Group]) -> Table:
    """Return a table of the policy's times by task and method: medians over episodes, and the longest tick."""
    rows: list[list[Entry]] = []
    for (task, robot), some in groups_by_task(groups).items():
        for line in series_of(some):
            records = [record for group in line.groups for record in group.records if max(record.tick_us) > 0.0]
            if records:
                ticks = np.array([record.tick_us[:3] for record in records]) / 1e3
                starts = [record.tick_us[3] / 1e3 for record in records if len(record.tick_us) > 3]
                speeds = [record.seconds / record.wall_seconds for record in records if record.wall_seconds > 0.0]
                values = [
                    median(ticks[:, 0]),
                    median(ticks[:, 1]),
                    float(ticks[:, 2].max()),
                    median(starts),
                    median(speeds),
                ]
                rows.append([task, robot, line.label, *map(number, values), *_slowest(records)])
    head = ["median [ms]", "99 % [ms]", "longest [ms]", "to the first motion [ms]", "times real time"]
    head += [f"above {1e3 * SLOW:.0f} ms of CPU time", "longest CPU time [ms]", "held ticks"]
    return Table(["task", "robot", "method", *head], rows, 3)


def _slowest(records: list[EpisodeRecord]) -> list[Entry]:
    """Return how many answers took more than `SLOW` of CPU time, the longest [ms], and the held control steps."""
    known = [record for record in records if record.calls]
    if not known:
        return [NOTHING] * 3
    slow, calls, held = (sum(getattr(each, name) for each in known) for name in ("slow_calls", "calls", "held"))
    live = any(not record.reproducible for record in known)
    return [f"{slow} of {calls}", number(max(each.longest_ms for each in known)), str(held) if live else NOTHING]


def costs(groups: list[Group]) -> Table:
    """Return a table of what each method needs besides its episodes: demonstrations, training steps, tuned settings."""
    rows: list[list[Entry]] = []
    for method in sorted({group.cell.method for group in groups}, key=place_of):
        settings = [group.cell.settings for group in groups if group.cell.method == method]
        steps = max((_steps(each) for each in settings), default=0)
        tuned = max(_leaves(each) for each in settings)
        demonstrations = "0" if method in WITHOUT_DEMONSTRATION else "1"
        rows.append([method, demonstrations, str(steps), str(tuned)])
    return Table(["method", "demonstrations", "environment steps", "settings changed"], rows, 1)


def _steps(settings: dict[str, object]) -> int:
    values = [settings.get(key) for key in STEPS_KEYS]
    return next((int(value) for value in values if isinstance(value, int | float)), 0)


def _leaves(settings: object) -> int:
    if not isinstance(settings, dict):
        return 1
    return sum(_leaves(value) for key, value in settings.items() if key not in ACTOR_KEYS)


def number(value: float) -> str:
    """Return a number with three significant digits and at most four decimals; a dash for NaN."""
    if math.isnan(value):
        return NOTHING
    if value == 0.0 or abs(value) >= 99.95:
        return f"{value:.0f}"
    digits = max(0, 2 - math.floor(math.log10(abs(value))))
    return f"{value:.{min(digits, 4)}f}"


def p_words(value: float) -> str:
    """Return a p-value as printed in papers."""
    return NOTHING if math.isnan(value) else "< 0.001" if value < 0.001 else f"{value:.3f}"
