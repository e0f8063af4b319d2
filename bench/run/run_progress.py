"""Progress display of a run on standard error: counts per cell and the time left."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager
from typing import Any

from ...configs import Grid, RunConfig
from ..console import labeled
from ..episodes.episode_records import EpisodeRecord


class RunProgress:
    """Progress of a grid on a console.

    Args:
        grid: the cells.
        console: see `console.console`.
    """

    def __init__(self, grid: Grid, console: Any):
        self._console = console
        self._labels = {cell.digest(): grid.label(cell) for cell in grid.cells}
        self._totals: Counter[str] = Counter()
        self._done: Counter[str] = Counter()
        self._succeeded: Counter[str] = Counter()
        self._bars: dict[str, Any] = {}
        self._progress: Any = None
        self._all: Any = None

    def say(self, text: str) -> None:
        """Print a line."""
        self._console.print(text)

    def warn(self, text: str) -> None:
        """Print a line, labeled as a warning."""
        self._console.print(labeled("warning", "yellow", text))

    def waiting(self, what: str) -> AbstractContextManager[Any]:
        """Show a status text while the context is open."""
        return self._console.status(what)

    @contextmanager
    def showing(self, episodes: Iterable[tuple[RunConfig, int]], done: Iterable[EpisodeRecord]) -> Iterator[None]:
        """Show progress bars while the context is open: one for all episodes, and one for each unfinished cell.

        Args:
            episodes: cell and scenario index of all episodes of this shard.
            done: records of the episodes that are already finished.
        """
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

        mine = {(cell.digest(), index) for cell, index in episodes}
        self._totals = Counter(cell for cell, _ in mine)
        before = [record for record in done if record.key in mine]
        for record in before:
            self._count(record)
        columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
        with Progress(*columns, console=self._console, transient=True) as self._progress:
            self._all = self._progress.add_task("all cells", total=len(mine), completed=len(before))
            yield

    def add(self, record: EpisodeRecord) -> None:
        """Count a finished episode; print a line for every completed cell."""
        cell = record.cell
        self._count(record)
        self._progress.update(self._all, advance=1)
        if len(self._totals) == 1:
            self._progress.update(self._all, description=self._line(cell))
            return
        if self._done[cell] == self._totals[cell]:
            self._console.print(self._line(cell))
            if cell in self._bars:
                self._progress.remove_task(self._bars.pop(cell))
            return
        if cell not in self._bars:
            self._bars[cell] = self._progress.add_task("", total=self._totals[cell])
        self._progress.update(self._bars[cell], completed=self._done[cell], description=self._line(cell))

    def _count(self, record: EpisodeRecord) -> None:
        self._done[record.cell] += 1
        self._succeeded[record.cell] += record.success

    def _line(self, cell: str) -> str:
        return f"{self._labels[cell]}: {self._succeeded[cell]} of {self._done[cell]} succeeded"
