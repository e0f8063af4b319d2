"""Speeds of whole runs: episodes against real time, two workers against one."""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from contextlib import ExitStack
from importlib.util import find_spec

from ...configs import RunConfig
from ..episodes.episode_records import known_record
from ..workers.dispatcher import Dispatcher, Job, WorkerBackend
from .measuring import Row, row

EPISODE = "Stack episode, policy included / real time"
PROCESSES = "two local workers, per episode / one"
ACTORS = "two Ray actors, per episode / one"
GEOMETRIC = "1000 geometric scenarios, all path generators, 2 cores / 5 minutes"
CONFIG = RunConfig(name="perf", task="stack", demonstration="stack", video=False)
SHORT = CONFIG.model_copy(update={"max_seconds": 10.0})
BATCH, BATCHES = 8, 3
"""Number of episodes timed together, and number of batches."""


def _jobs(config: RunConfig, count: int) -> list[Job]:
    """Return episode jobs as a run creates them."""
    from ..run.episode_jobs import EpisodeJobs

    cell = config.model_dump(mode="json")
    bench = EpisodeJobs()
    drawn = bench.do({"kind": "draw", "cell": cell, "indices": list(range(count))})["drawn"]
    bench.close()
    base = {"kind": "episode", "cell": cell, "scenario": ""}
    return [{**base, "index": k, "start": each["start"]} for k, each in enumerate(drawn)]


def _episode() -> Row:
    """Measure the processor time of episodes against their simulated time."""
    from ..run.episode_jobs import EpisodeJobs

    bench, jobs, shares = EpisodeJobs(), _jobs(CONFIG, 5), []
    for job in jobs:
        begun = time.process_time()
        record = bench.do(job)["record"]
        shares.append((time.process_time() - begun) / record["seconds"])
    bench.close()
    # the first episode compiles the remaining kernels
    share = statistics.median(shares[1:])
    note = f"{1.0 / share:.1f} times as fast as real time on one core, physics and planner; processor time"
    return row(EPISODE, share, "ratio", 1 / 3, note)


def _efficiency(name: str, backend: WorkerBackend) -> Row:
    """Measure two workers against one, both warm; batches alternate, so that noise affects both."""
    jobs, seconds, busy = _jobs(SHORT, BATCH), {1: [], 2: []}, []
    executors = {count: Dispatcher(backend, count, 600.0) for count in seconds}
    with ExitStack() as held:
        held.callback(backend.close)
        for executor in executors.values():
            held.callback(executor.stop_all)
        for executor in executors.values():
            list(executor.results(jobs))
        for _ in range(BATCHES):
            for count, executor in executors.items():
                begun = time.perf_counter()
                done = list(executor.results(jobs))
                seconds[count].append(time.perf_counter() - begun)
                records = [known_record((outcome.answer or {})["record"]) for outcome in done]
                busy.append(sum(record.wall_seconds for record in records) / seconds[count][-1] / count)
    one, two = (statistics.median(seconds[count]) for count in (1, 2))
    note = (
        f"{two / BATCH * 1e3:.0f} ms against {one / BATCH * 1e3:.0f} ms: efficiency {one / two / 2:.2f}, on idle "
        f"cores; workers are in an episode {statistics.median(busy):.0%} of the time"
    )
    return row(name, 2.0 * two / one, "ratio", 1 / 0.9, note)


def _processes() -> Row:
    from ..run.episode_jobs import EpisodeJobs
    from ..workers.processes import Processes, command_of

    return _efficiency(PROCESSES, Processes(command_of(EpisodeJobs)))


def _actors() -> Row:
    if find_spec("ray") is None:
        return Row(ACTORS, None, "ratio", 1 / 0.9, None, "needs: pip install 'onedemo[ray]'")
    from ..run.episode_jobs import EpisodeJobs
    from ..workers.ray_actors import RayActors

    return _efficiency(ACTORS, RayActors(None, 3, EpisodeJobs))


def _geometric() -> Row:
    """Measure the processor time of drawing, planning and judging some geometric scenarios of every cell."""
    from ..geometric.command import missing
    from ..geometric.jobs import TRACKS, rows_of
    from ..geometric.suite import cells, drawn, scenario_of

    methods = [name for name in TRACKS["paths"] if name != "rrt" and not missing(name)]
    count, seconds, paths = 3 * len(cells()), 0.0, 0
    for k in range(-len(cells()), count):  # the first round compiles
        begun = time.process_time()
        scenario = scenario_of(drawn(abs(k), 0))
        rows = rows_of(scenario, "paths", scenario.level, methods)
        if k >= 0:
            seconds, paths = seconds + time.process_time() - begun, paths + len(rows)
    note = (
        f"{seconds / paths * 1e3:.0f} ms a path of {len(methods)} methods, drawing and judging included; processor time"
    )
    return row(GEOMETRIC, seconds / count * 1000.0 / 2.0 / 300.0, "ratio", 1.0, note)


RUN_LINES: dict[str, Callable[[], Row]] = {
    EPISODE: _episode,
    PROCESSES: _processes,
    ACTORS: _actors,
    GEOMETRIC: _geometric,
}
"""Measurements by name."""
