"""`onedemo train`: a config in, learning curves and actors out; interrupted trainings continue where they stopped."""

from __future__ import annotations

import json
import shlex
from collections import deque
from contextlib import ExitStack
from pathlib import Path
from typing import Any

from ...configs import BadConfig, TrainConfig, load_training, shipped_training
from ...configs.train_config import training_of
from ...planner.errors import UnknownName
from ..atomic_files import write_whole
from ..console import console
from ..episodes.run_folder import LOG, open_folder
from ..interruption import ended
from ..provenance import LEARNING, fingerprint
from ..run.own_task import is_own_task, own_config
from ..workers.dispatcher import HUNG, Dispatcher, Executor, Job, WorkerFailed
from ..workers.executors import Serial, cores
from .folder import CONFIG, SEED, curve_of, seeds_of, write_curves
from .progress import progress, steps_done

OWN = {"algorithm": "sac", "steps": 100_000}
"""Values with which a user's own task is trained unless others are given."""


def run_training(config: str, overrides: list[str], output: Path, *, quiet: bool = False) -> int:
    """Train as a config says and write the training's folder.

    Args:
        config: config file, the name of a shipped training, or the dotted path of a task.
        overrides: `key=value` changes to the config.
        output: parent folder of the training's folder.
        quiet: print only the folder and errors.

    Returns:
        The exit code.

    Raises:
        BadConfig: the config, an override or the demonstration cannot be used.
        MissingExtra: torch or Stable-Baselines3 is not installed.
        RunBusy: another process writes into the same folder.
    """
    if is_own_task(config):
        chosen = training_of({**OWN, **own_config(config, overrides)}, config, overrides)
    else:
        chosen = load_training(_path(config), overrides)
    check(chosen)
    folder = output / f"{chosen.name}-{chosen.digest()}"
    err = console(stderr=True, quiet=quiet)

    def work() -> list[str]:
        with ExitStack() as held:
            open_folder(folder, held)
            _describe(chosen, folder, shlex.join(["onedemo", "train", config, *overrides]))
            with _executor(chosen, folder) as executor:
                train(chosen, folder, executor, err)
            return write_curves(chosen, folder)

    return ended(work, folder, "finished evaluations and what was learned by then", quiet=quiet)


def check(config: TrainConfig) -> None:
    """Refuse an impossible training before anything is built.

    Raises:
        BadConfig: an unknown name, argument or setting, or a device that torch cannot use.
        MissingExtra: torch or Stable-Baselines3 is not installed.
    """
    from ...baselines.extras import needed
    from .config_checks import check_training
    from .learners import EXTRA

    torch: Any = needed("torch", EXTRA)
    needed("stable_baselines3", EXTRA)
    check_training(config)
    try:
        torch.empty(0, device="cpu" if config.device == "auto" else config.device)
    except (RuntimeError, AssertionError) as error:
        # Stable-Baselines3 would silently train on the CPU instead
        reason = f"torch cannot use {config.device!r} here: {str(error).splitlines()[0]}; auto takes what there is"
        raise BadConfig(config.name, "device", reason) from None


def train(config: TrainConfig, folder: Path, executor: Executor, err: Any) -> None:
    """Run the missing training rounds, with the seeds in parallel.

    Args:
        config: the training.
        folder: folder of the training.
        executor: runs the training jobs.
        err: console for progress.

    Raises:
        BadConfig: a worker refuses the config.
        WorkerFailed: workers died twice or crashed.
    """
    waiting: deque[Job] = deque()
    done = {seed: len(curve_of(folder, seed)) for seed in seeds_of(config)}
    for seed, legs in done.items():
        if legs < config.legs:
            waiting.append(_job(config, folder, seed, legs + 1))
    err.print(
        f"{config.name}: {config.algorithm} on {config.task}, {config.seeds} seed{'s' * (config.seeds != 1)}, "
        f"{config.steps} steps each, evaluated every {config.evaluate_every}: {folder}"
    )
    with progress(lambda: steps_done(config, folder, done), config.steps * config.seeds, err):
        for outcome in executor.results(waiting):
            seed, leg = outcome.job["seed"], outcome.job["leg"]
            point = _point(config, outcome)
            success = sum(point["successes"]) / len(point["successes"])
            average = sum(point["returns"]) / len(point["returns"])
            err.print(f"seed {seed}, {point['steps']} steps: {success:.0%} succeed, return {average:.1f}")
            done[seed] = leg
            if leg < config.legs:
                # queued first: the worker that is free now has this learner in memory
                waiting.appendleft(_job(config, folder, seed, leg + 1))


def _point(config: TrainConfig, outcome: Any) -> dict[str, Any]:
    answer = outcome.answer
    if answer is None:
        hung = f"took longer for {config.evaluate_every} steps than wall_seconds, {config.wall_seconds:g},"
        how = hung if outcome.lost == HUNG else "died"
        raise WorkerFailed(f"{config.name}, seed {outcome.job['seed']}: a worker {how} twice; see {LOG}")
    if "crash" in answer:
        raise WorkerFailed(f"{config.name}: {answer['crash']}; see {LOG}")
    if "refused" in answer:
        raise BadConfig(config.name, answer["key"], answer["refused"].removeprefix(f"{config.name}: "))
    return answer["point"]


def _job(config: TrainConfig, folder: Path, seed: int, leg: int) -> Job:
    own = str((folder / SEED.format(seed)).resolve())
    return {"kind": "train", "cell": config.model_dump(mode="json"), "seed": seed, "leg": leg, "folder": own}


def _executor(config: TrainConfig, folder: Path) -> Executor:
    from .jobs import TrainingJobs

    if config.executor == "serial":
        return Serial(TrainingJobs())
    workers = max(1, min(config.workers or cores(), config.seeds))
    if config.executor == "process":
        from ..workers.processes import Processes, command_of

        backend: Any = Processes(command_of(TrainingJobs), folder / LOG)
    else:
        from ..workers.ray_actors import RayActors

        backend = RayActors(config.address, workers, TrainingJobs, folder / LOG)
    return Dispatcher(backend, workers, config.wall_seconds)


def _path(config: str) -> Path:
    path = Path(config)
    if path.exists():
        return path
    try:
        return shipped_training(path.stem)
    except UnknownName as error:
        known = ", ".join(map(str, error.known))
        raise BadConfig(config, "", f"no such file, and no training that is shipped: {known}") from None


def _describe(config: TrainConfig, folder: Path, command: str) -> None:
    """Write the config and the environment of the training into its folder."""
    write_whole(folder / CONFIG, json.dumps(config.model_dump(mode="json"), indent=1) + "\n")
    write_whole(
        folder / "environment.json", json.dumps({**fingerprint(*LEARNING), "command": command}, indent=2) + "\n"
    )
