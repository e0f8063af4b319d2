"""Completion of a comparison: missing episodes are run, and every record is written as soon as it is finished."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

from ...configs import BadConfig, Grid, RunConfig
from ...configs.run_config import CELL_KEYS, cell_of
from ...planner.errors import OneDemoError
from ..episodes.episode_records import EpisodeRecord, RecordWriter, known_record
from ..episodes.run_folder import LOG, WHOLE, Shard, alone, recorded
from ..episodes.scenarios import Suite, frozen, lists_of, read_suite, scenarios_of
from ..workers.dispatcher import HUNG, WORKER_DIED, Answer, Executor, Job, Outcome, WorkerFailed
from .episode_jobs import lost_record
from .run_progress import RunProgress

DRAWN_AT_ONCE = 10
"""Number of scenarios per drawing job."""
Records = dict[tuple[str, int], EpisodeRecord]
"""Episode records by cell digest and scenario index."""


class Comparison:
    """Run of a grid in its run folder.

    Args:
        grid: the cells to compare.
        folder: run folder, locked by this process.
        board: progress display.
        shard: the part of the episodes that is run here.
        retry: rerun the episodes that were lost with their workers.
    """

    def __init__(self, grid: Grid, folder: Path, board: RunProgress, shard: Shard = WHOLE, *, retry: bool = False):
        self.grid, self.folder, self.shard, self.board, self.retry = grid, folder, shard, board, retry

    def complete(self, executor: Executor) -> Records:
        """Draw the scenarios if necessary, run the missing episodes and return the records of all finished ones.

        Raises:
            BadConfig: a cell cannot be run.
            ScenarioChanged: the environment draws other starts than the frozen ones.
            WorkerFailed: workers died twice or crashed.
            OSError: a file cannot be written (disk full).
        """
        suite = read_suite(self.folder)
        if suite is None:
            with alone(self.folder, "suite"):
                suite = read_suite(self.folder) or self._drawn_suite(executor)
            self.board.say(suite.summary())
        records, notes = recorded(self.folder, self.grid.cells, suite)
        for note in notes:
            self.board.warn(note)
        if self.retry:
            records = {key: record for key, record in records.items() if not record.lost}
        todo = self.missing(suite, records)
        if records:
            self.board.say(f"{len(records)} of {len(self.mine(suite))} episodes were done before")
        if todo:
            self._prepare(executor, {cell.digest(): cell for cell, _ in todo}.values())
            self._run(executor, suite, records, todo)
        return records

    def mine(self, suite: Suite) -> list[tuple[RunConfig, int]]:
        """Return cell and scenario index of every episode of this shard."""
        every = [(cell, each.index) for cell in self.grid.cells for each in suite.feasible(cell)]
        return every[self.shard.index - 1 :: self.shard.count]

    def missing(self, suite: Suite, records: Records) -> list[tuple[RunConfig, int]]:
        """Return cell and scenario index of the unfinished episodes of this shard.

        Args:
            suite: the frozen scenarios.
            records: the finished episodes.
        """
        return [(cell, index) for cell, index in self.mine(suite) if (cell.digest(), index) not in records]

    def _drawn_suite(self, executor: Executor) -> Suite:
        self._prepare(executor, self.grid.cells)
        lists = lists_of(self.grid.cells)
        jobs = [
            {"kind": "draw", "cell": cell.model_dump(mode="json"), "indices": indices, "list": k}
            for k, cell in enumerate(lists)
            for indices in _chunks(range(cell.episodes))
        ]
        found: dict[tuple[int, int], dict[str, Any]] = {}
        with self.board.waiting("drawing the scenarios"):
            for job, answer in self._answers(executor, jobs):
                for index, drawn in zip(job["indices"], answer["drawn"], strict=True):
                    found[job["list"], index] = frozen(lists[job["list"]], index, drawn)
        suite = Suite([found[key] for key in sorted(found)])
        for cell in self.grid.cells:
            if not suite.feasible(cell):
                reason = f"none of its scenarios can be drawn: {suite.of(cell, 0)['infeasible']}"
                raise self._refusal(cell, {"key": "level", "refused": reason})
        suite.write(self.folder)
        return suite

    def _prepare(self, executor: Executor, cells: Iterable[RunConfig]) -> None:
        """Build environments and policies of all cells, so that unusable cells are refused before any episode runs."""
        jobs = [{"kind": "prepare", "cell": cell.model_dump(mode="json")} for cell in cells]
        with self.board.waiting("building the scenes and the planner (compiled on first use: about a minute)"):
            for _ in self._answers(executor, jobs):
                pass

    def _run(self, executor: Executor, suite: Suite, records: Records, todo: list[tuple[RunConfig, int]]) -> None:
        writer = RecordWriter(self.folder / self.shard.file)
        try:
            with self.board.showing(self.mine(suite), records.values()):
                for outcome in executor.results([self._episode_job(suite, *each) for each in todo]):
                    record = self._record(outcome)
                    writer.append(record)
                    records[record.key] = record
                    self.board.add(record)
        finally:
            writer.close()

    def _episode_job(self, suite: Suite, cell: RunConfig, index: int) -> Job:
        scenario = suite.of(cell, index)
        start = {"start": scenario["start"], "scenario": scenario["fingerprint"]}
        kept = str((self.folder / "trajectories").resolve()) if cell.trajectories else None
        return {"kind": "episode", "cell": cell.model_dump(mode="json"), "index": index, **start, "trajectories": kept}

    def _record(self, outcome: Outcome) -> EpisodeRecord:
        """Return the record of an episode, also if the episode was lost with its worker twice."""
        if not outcome.lost:
            return known_record(self._checked(outcome)["record"])
        config, index = cell_of(outcome.job["cell"]), outcome.job["index"]
        scenario = scenarios_of(config)[index]
        how = f"took more than {outcome.seconds:.0f} s of real time" if outcome.lost == HUNG else "died"
        self.board.warn(f"{self.grid.label(config)}, seed {scenario.seed}: the worker {how}, twice; see {LOG}")
        record = lost_record(config, scenario, outcome.lost, f"the worker {how}, twice", outcome.seconds)
        return replace(record, scenario=outcome.job["scenario"])

    def _answers(self, executor: Executor, jobs: Sequence[Job]) -> Iterator[tuple[Job, Answer]]:
        for outcome in executor.results(jobs):
            yield outcome.job, self._checked(outcome)

    def _checked(self, outcome: Outcome) -> Answer:
        """Return the answer to a job; raise if the run cannot continue."""
        config = cell_of(outcome.job["cell"])
        cell = f"in the cell {self.grid.label(config)}"
        if outcome.answer is None:
            how = "died" if outcome.lost == WORKER_DIED else "hung"
            raise WorkerFailed(f"{self.folder / LOG}: a worker {how} twice, {cell}")
        if "crash" in outcome.answer:
            raise WorkerFailed(f"{self.folder / LOG}: {outcome.answer['crash']}, {cell}")
        if "refused" in outcome.answer:
            raise self._refusal(config, outcome.answer)
        return outcome.answer

    def _refusal(self, config: RunConfig, answer: Answer) -> OneDemoError:
        """Return the error for a refused job, with the config key to blame and a way out."""
        key, reason = answer["key"], answer["refused"]
        if not key:
            return OneDemoError(reason)
        full = key if key in CELL_KEYS else f"env.{key}" if key in config.env else f"settings.{key}"
        if len(self.grid.cells) > 1:
            reason = f"{reason} (in the cell {self.grid.label(config)}); `exclude:` leaves combinations out"
        return BadConfig(self.grid.blame(full), full, reason)


def _chunks(indices: range) -> Iterator[list[int]]:
    for first in range(0, len(indices), DRAWN_AT_ONCE):
        yield list(indices[first : first + DRAWN_AT_ONCE])
