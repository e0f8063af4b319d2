"""`onedemo run`: a config in, a run folder out; interrupted runs go on where they stopped."""

from __future__ import annotations

import errno
import json
import warnings
from contextlib import ExitStack
from dataclasses import asdict
from inspect import signature
from pathlib import Path
from typing import TYPE_CHECKING, Any

from ..configs.schema import RunConfig, load_config
from ..configs.shipped import shipped_config
from ..planner.errors import BadConfig, BadDemonstration
from .console import COMMAND_LINE, console, labeled
from .demo_commands import demonstration_path
from .records import FILE, EpisodeRecord, RecordWriter, locked, read_records
from .scenarios import scenarios_of
from .tasks import TASKS

if TYPE_CHECKING:
    from ..baselines.policy import Policy
    from ..planner.demo import Demonstration

DISK_FULL, INTERRUPTED = 3, 130
NO_SPACE = (errno.ENOSPC, errno.EDQUOT)
RUN_KEYS = ("robot", "level", "obstacles", "render_mode")
"""Arguments of environments that are keys of a config themselves."""


def run_config(config: str, overrides: list[str], output: Path, *, quiet: bool = False) -> int:
    """Run a config and write its folder; returns the exit code.

    Raises:
        BadConfig: the config, an override or the demonstration cannot be used.
        RunBusy: another process writes into the same folder.
    """
    source = config_path(config)
    settings = load_config(source, overrides)
    folder = output / f"{settings.name}-{settings.digest()}"
    err = console(stderr=True, quiet=quiet)
    try:
        with ExitStack() as held:
            _open_folder(folder, held)
            env, policy = _built(settings, source, overrides, err)
            held.callback(env.close)
            command = " ".join(["onedemo run", config, *overrides])
            lines = _run(env, policy, settings, folder, command, err)
    except KeyboardInterrupt:
        err.print(f"stopped; finished episodes are kept in {folder}, running the same again goes on")
        return INTERRUPTED
    except OSError as error:
        reason = error.strerror or type(error).__name__
        text = f"{folder}: {reason}; finished episodes are kept, running the same again goes on"
        console(stderr=True).print(labeled("error", "red", text))
        return DISK_FULL
    out = console(quiet=quiet)
    for line in lines:
        out.print(line)
    console().print(str(folder))
    return 0


def config_path(config: str) -> Path:
    """The file itself, or the shipped config of that name, also for a path as it stands in the source tree."""
    path = Path(config)
    if path.exists():
        return path
    if path.suffix in ("", ".yaml") and str(path.parent) in (".", "configs/bench"):
        return shipped_config(path.stem)
    raise BadConfig(path, "", "no such file")


def _open_folder(folder: Path, held: ExitStack) -> None:
    """Make the run folder and hold it for this process.

    Raises:
        BadConfig: nothing can be written there.
        RunBusy: another process writes there.
    """
    try:
        folder.mkdir(parents=True, exist_ok=True)
        held.enter_context(locked(folder))
    except OSError as error:
        if error.errno in NO_SPACE:
            raise
        raise BadConfig(COMMAND_LINE, "--output", f"no run folder at {folder}: {error.strerror}") from None


def _built(config: RunConfig, source: Path, overrides: list[str], err: Any) -> tuple[Any, Policy]:
    """The environment and the policy, and what is being waited for."""
    with err.status("building the scene and the planner (compiled on first use: about half a minute)"):
        return prepared(config, source, overrides)


def _run(env: Any, policy: Policy, config: RunConfig, folder: Path, command: str, err: Any) -> list[str]:
    _describe(config, folder)
    records = _episodes(env, policy, config, folder, err)
    return _report(env, policy, config, folder, records, command, err)


def prepared(config: RunConfig, source: Path, overrides: list[str]) -> tuple[Any, Policy]:
    """The environment and the policy of a config, compiled and warm.

    Raises:
        BadConfig: the config names something wrongly; with its key.
        BadDemonstration: the demonstration is of something else.
    """
    from ..baselines.factory import make_policy
    from ..baselines.screw_policy import PROGRAMS
    from ..planner import reactive
    from ..planner.demo_io import load_demonstration

    _check_names(config, source, overrides)
    file = demonstration_path(config.demonstration)
    demonstration = load_demonstration(file)
    shown = TASKS[config.task].shown or config.task
    _check_demonstration(demonstration, file, shown, PROGRAMS[config.task].SEGMENTS)
    env: Any = _made(config, source)
    task = env.unwrapped.task
    for arm, body in zip(task.arms, task.bodies, strict=True):
        reactive.warm_up(arm, body)
    return env, make_policy(config.method, task, demonstration, config.settings)


def _made(config: RunConfig, source: Path) -> Any:
    """The environment of a config.

    Raises:
        BadConfig: the environment does not know an argument.
    """
    import gymnasium as gym
    from gymnasium.envs.registration import load_env_creator

    from .. import envs  # noqa: F401  (registers the ids)

    name = TASKS[config.task].id
    known = [
        key for key in signature(load_env_creator(str(gym.spec(name).entry_point))).parameters if key not in RUN_KEYS
    ]
    for key in config.env:
        if key not in known:
            reason = f"{name} has no such argument; allowed: {', '.join(known) or 'none'}"
            raise BadConfig(source, f"env.{key}", reason)
    limit = None if config.max_seconds is None else max(1, round(config.max_seconds * 50))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return gym.make(
            name,
            robot=config.robot,
            level=config.level,
            obstacles=config.obstacles,
            render_mode="rgb_array" if config.video else None,
            max_episode_steps=limit,
            **config.env,
        )


def _check_names(config: RunConfig, source: Path, overrides: list[str]) -> None:
    """Refuse unknown names, and say where they were written."""
    from ..baselines.factory import POLICIES
    from ..envs.levels import LEVELS, OBSTACLES
    from ..envs.robots import ROBOTS

    changed = {text.partition("=")[0] for text in overrides}
    names = {"task": TASKS, "level": LEVELS, "robot": ROBOTS, "method": POLICIES, "obstacles": (None, *OBSTACLES)}
    for key, known in names.items():
        value = getattr(config, key)
        if value not in known:
            where = COMMAND_LINE if key in changed else source
            raise BadConfig(where, key, f"unknown {key} {value!r}; known: {', '.join(map(str, known))}")


def _check_demonstration(demonstration: Demonstration, file: Path, task: str, segments: tuple[str, ...]) -> None:
    """Refuse a demonstration of something else."""
    if demonstration.task != task:
        raise BadDemonstration(file, "task", f"is {demonstration.task!r}; the task of this run is {task!r}")
    names = [segment.name for segment in demonstration.segments]
    for name in segments:
        if name not in names:
            there = ", ".join(names) or "none"
            reason = f"{name!r} is missing; {task!r} needs {', '.join(segments)}, there are: {there}"
            raise BadDemonstration(file, "segment_names", reason)


def _describe(config: RunConfig, folder: Path) -> None:
    """Write what the run is; refuse a folder that holds another one."""
    from ruamel.yaml import YAML

    from .environment import fingerprint

    described = {"digest": config.digest(), "scenarios": [asdict(scenario) for scenario in scenarios_of(config)]}
    file = folder / "scenarios.json"
    if file.exists() and json.loads(file.read_text(encoding="utf-8")).get("digest") != config.digest():
        raise BadConfig(file, "digest", "the folder belongs to another config; choose another --output")
    file.write_text(json.dumps(described, indent=1) + "\n", encoding="utf-8")
    with (folder / "config.yaml").open("w", encoding="utf-8") as stream:
        YAML(typ="safe", pure=True).dump(config.model_dump(mode="json"), stream)
    text = json.dumps(fingerprint(), indent=2) + "\n"
    (folder / "environment.json").write_text(text, encoding="utf-8")


def _episodes(env: Any, policy: Policy, config: RunConfig, folder: Path, err: Any) -> list[EpisodeRecord]:
    """Run what is missing; all records, in order."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    from .episode import run_episode

    file = folder / FILE
    known, foreign = read_records(file)
    for number in foreign:
        err.print(labeled("warning", "yellow", f"{file}, line {number}: not an episode record, skipped"))
    records = {record.index: record for record in known if record.index < config.episodes}
    todo = [scenario for scenario in scenarios_of(config) if scenario.index not in records]
    if records:
        err.print(f"{len(records)} of {config.episodes} episodes were done before")
    writer = RecordWriter(file)
    kept = folder / "trajectories" if config.trajectories else None
    columns = (TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeRemainingColumn())
    try:
        with Progress(*columns, console=err, transient=True) as progress:
            bar = progress.add_task(f"{config.name} {config.level}", total=config.episodes, completed=len(records))
            for scenario in todo:
                record, _ = run_episode(env, policy, scenario, config, trajectories=kept)
                writer.append(record)
                records[record.index] = record
                successes = sum(done.success for done in records.values())
                text = f"{config.name} {config.level}  {successes}/{len(records)} succeeded"
                progress.update(bar, advance=1, description=text)
    finally:
        writer.close()
    return [records[index] for index in sorted(records)]


def _report(
    env: Any, policy: Policy, config: RunConfig, folder: Path, records: list[EpisodeRecord], command: str, err: Any
) -> list[str]:
    """Figure, video, report and summary; the lines for the terminal."""
    from .cell_report import report_text, summary_row, verdict, write_summary
    from .figures import draw_episode
    from .showcase import watch

    figure, video = folder / "episode0.png", folder / "episode0.mp4"
    with err.status("drawing the first episode"):
        seen = watch(env, policy, scenarios_of(config)[0], config, video if config.video else None)
        title = f"{config.task}, {config.robot}, {config.level}, seed {config.seed}: one demonstration, {config.method}"
        draw_episode(seen, title, [figure, figure.with_suffix(".pdf")])
    row = summary_row(config, records)
    write_summary(folder / "summary.json", [row])
    notes = [
        f"![demonstration, final paths and executed path]({figure.name})",
        "Blue: the demonstration where it was given. Magenta: the final paths. Dashed: the executed path.",
    ]
    lines = [*verdict(row), f"report  {folder / 'report.md'}", f"figure  {figure}"]
    if seen.video_problem:
        notes.append(f"No video: {seen.video_problem}.")
        lines.append(f"no video: {seen.video_problem}")
    elif config.video:
        notes.append(f"Video, {seen.speed:.0f} times as fast as the simulation: [{video.name}]({video.name})")
        lines.append(f"video   {video}")
    text = report_text(config, records, row, notes, command)
    if config.video and not seen.video_problem:
        with err.status("recording failures"):
            lines += _failure_videos(env, policy, config, folder, records)
    (folder / "report.md").write_text(text, encoding="utf-8")
    return lines


def _failure_videos(
    env: Any, policy: Policy, config: RunConfig, folder: Path, records: list[EpisodeRecord]
) -> list[str]:
    """Videos of the first failure of each kind; the lines for the terminal."""
    from .failure_videos import record_video
    from .videos import chosen, video_of

    lines = []
    for record in chosen(records):
        problem = record_video(env, policy, record, config, folder)
        lines.append(f"failure {problem or folder / video_of(record).file}")
    return lines
