"""A worker that trains: it keeps the learner it had last, and goes on from the disk with any other.

| job | besides "cell" (the config) | answer |
|---|---|---|
| "prepare" | | {} |
| "train" | "seed", "leg", "folder" | "point": see `training.Point` |
"""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Any

from ...configs.train_config import TrainConfig
from ...planner.errors import OneDemoError
from ..run.episode_jobs import refusal
from ..workers.dispatcher import Answer, Job
from ..workers.worker_process import main


class TrainingJobs:
    """Does the jobs of trainings."""

    def __init__(self) -> None:
        self._trainee: Any = None
        self._at = ("", -1)

    def do(self, job: Job) -> Answer:
        """The answer to a job."""
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
        # a job that is given out once more may have been finished just before its worker died
        done = self._trainee.points
        point = done[leg - 1] if len(done) >= leg else self._trainee.run_leg()
        self._at = (folder, leg + 1)
        return point

    def close(self) -> None:
        """Forget the learner."""
        self._trainee = None


if __name__ == "__main__":
    main(TrainingJobs())
