"""A handler of jobs without a simulator: quick, deterministic, and told by FAKE in the environment what to suffer.

FAKE is JSON: `{"pause": seconds, "marks": folder, "faults": {"index": [fault, times]}}`. As a script it is a worker.
"""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np

from onedemo.bench.episodes.episode_records import EpisodeRecord
from onedemo.bench.workers.worker_process import main
from onedemo.configs.run_config import RunConfig

BLANK = EpisodeRecord(0, 0, "", "", "", "", True, True, "", "", "", "", 1.0, 0, None, 0, {}, 0.0, [])


class FakeJobs:
    def __init__(self):
        self.told = json.loads(os.environ.get("FAKE", "{}"))

    def do(self, job):
        config = RunConfig.model_validate(job["cell"])
        if job["kind"] == "draw":
            return {"drawn": [self.start(config, index) for index in job["indices"]]}
        if job["kind"] == "episode":
            self.suffer(job["index"])
            time.sleep(self.told.get("pause", 0.0))
            return {"record": asdict(fake_record(config, job["index"], job["scenario"]))}
        if job["kind"] == "show":
            return {"video": False, "figure_problem": "nothing to be seen"}
        if job["kind"] == "film":
            return {"problem": "nothing to be seen"}
        return {}

    def close(self):
        pass

    def start(self, config, index):
        if index in self.told.get("infeasible", ()):
            return {"infeasible": "no room"}
        return {"start": {"x": [0.1 * (config.seed + index)]}, "refused": index % 3}

    def suffer(self, index):
        """The fault of an episode, as often as it is told, counted over all processes."""
        fault, times = self.told.get("faults", {}).get(str(index), ("", 0))
        marks = Path(self.told.get("marks", "."))
        if len(list(marks.glob(f"{index}-*"))) >= times:
            return
        (marks / f"{index}-{time.time_ns()}").touch()
        if fault == "die":
            os.kill(os.getpid(), signal.SIGKILL)
        elif fault == "stop":
            os.kill(os.getpid(), signal.SIGSTOP)
        elif fault == "endless":
            while True:
                pass
        elif fault == "raise":
            raise ValueError("a mistake")


def fake_record(config, index, scenario):
    rng = np.random.default_rng([config.seed + index, int(config.digest(), 16) % 1000])
    return replace(
        BLANK,
        index=index,
        seed=config.seed + index,
        method=config.method,
        task=config.task,
        robot=config.robot,
        level=config.level,
        success=bool(rng.uniform() < 0.8),
        numbers={"position_error": [float(rng.uniform())]},
        wall_seconds=time.monotonic(),
        tick_us=[1.0, 2.0, float(time.monotonic()), 3.0],
        cell=config.digest(),
        scenario=scenario,
    )


if __name__ == "__main__":
    main(FakeJobs())
