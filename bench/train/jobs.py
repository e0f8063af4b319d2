"""Job handler for trainings: keeps its last learner in memory and loads any other one from the disk.

| job | keys besides "cell" (the config) | answer |
|---|---|---|
| "prepare" | | {} |
| "train" | "seed", "leg", "folder" | "point": see `evaluations.Point` |
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...configs import TrainConfig
from ...planner.errors import OneDemoError
from ..run.episode_jobs import refusal
from ..workers.dispatcher import Answer, Job
from ..workers.worker_process import main


class TrainingJobs:
    """Job handler of `onedemo train`."""

    def __init__(self) -> None:
        self._trainee: Any = None
        self._at = ("", -1)

    def do(self, job: Job) -> Answer:
        """See `JobHandler`."""
        if job["kind"] != "train":
            return {}
        try:
            return {"point": asdict(self._trained(job))}
        except OneDemoError as error:
            return refusal(error)

    def _trained(self, job: Job) -> Any:
        from .one_seed import Trainee

        folder, leg = job["folder"], job["leg"]
        if self._at != (folder, leg):
            self._trainee = None
            self._trainee = Trainee(TrainConfig.model_validate(job["cell"]), job["seed"], Path(folder))
        # the job may be a retry of one that was finished just before its worker died
        done = self._trainee.points
        point = done[leg - 1] if len(done) >= leg else self._trainee.run_leg()
        self._at = (folder, leg + 1)
        return point

    def close(self) -> None:
        """Drop the learner."""
        self._trainee = None


if __name__ == "__main__":
    main(TrainingJobs())
