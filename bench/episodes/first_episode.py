"""The first episode once more, watched: what the figure and the video are made from."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...baselines.policy import LabeledPath, Policy
from ...baselines.programs.world_model import obstacles_in
from ...configs.grid import RunConfig
from ...envs.core.description import TaskObject
from ...planner.errors import RenderingUnavailable
from ...planner.geometry.pose import Pose
from ...planner.geometry.shapes import Obstacle
from .episode import run_episode
from .scenarios import Scenario

EVERY = 4
"""Control steps per picture."""
FRAMES_PER_SECOND = 25


@dataclass
class Showcase:
    """What was seen of an episode.

    Attributes:
        objects: what was moved.
        table_height: [m].
        start: (n, 7) object poses at the start.
        goals: (n, 7) where they had to end.
        end: (n, 7) object poses at the end.
        executed: (steps + 1, 3) the tcp [m].
        paths: what the policy planned.
        furniture: what stands there.
        obstacles: by name, the last that was seen of each.
        traces: by name, (n, 3) where it was [m].
        speed: how much faster than reality the video plays.
        video_problem: "" or why there is no video.
    """

    objects: tuple[TaskObject, ...]
    table_height: float
    start: np.ndarray = field(default_factory=lambda: np.zeros((0, 7)))
    goals: np.ndarray = field(default_factory=lambda: np.zeros((0, 7)))
    end: np.ndarray = field(default_factory=lambda: np.zeros((0, 7)))
    executed: np.ndarray = field(default_factory=lambda: np.zeros((0, 3)))
    paths: tuple[LabeledPath, ...] = ()
    furniture: tuple[Obstacle, ...] = ()
    obstacles: dict[str, Obstacle] = field(default_factory=dict)
    traces: dict[str, list[np.ndarray]] = field(default_factory=dict)
    speed: float = 1.0
    video_problem: str = ""


def watch(env: Any, policy: Policy, scenario: Scenario, config: RunConfig, video: Path | None) -> Showcase:
    """Run a scenario and keep what was seen; write the video on the way, if one is wanted and can be drawn."""
    task = env.unwrapped.task
    seen = Showcase(task.objects, task.table_height)
    tcp: list[np.ndarray] = []
    film = Film(video) if video else None

    def observer(env: Any, observation: dict[str, np.ndarray]) -> None:
        if not tcp:
            seen.start, seen.goals = observation["object_pose"], observation["goal_pose"]
            for each, pose in zip(task.furniture, observation.get("furniture_pose", ()), strict=True):
                seen.furniture += each.at(Pose.from_vector(pose))
        tcp.append(observation["tcp_pose"][0, :3])
        seen.end = observation["object_pose"]
        for obstacle in obstacles_in(observation):
            seen.obstacles[obstacle.name] = obstacle
            seen.traces.setdefault(obstacle.name, []).append(obstacle.pose.position)
        if film and len(tcp) % EVERY == 1:
            film.take(env)

    with film or nullcontext():
        _, report = run_episode(env, policy, scenario, config, observer)
    seen.executed, seen.paths = np.array(tcp), report.paths
    seen.speed = FRAMES_PER_SECOND * EVERY * env.unwrapped.control_dt
    seen.video_problem = film.problem if film else ""
    return seen


class Film:
    """An mp4 that is written picture by picture; it appears under its name only when all of it can be read again.

    Used in a `with` statement: what is broken off leaves no file.
    """

    def __init__(self, path: Path):
        self._path, self._part = path, path.with_suffix(".part.mp4")
        self._writer: Any = None
        self._count = 0
        self.problem = ""

    def __enter__(self) -> Film:
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._end()
        if kind is None and self._writer is not None and not self.problem:
            if self._readable_pictures() == self._count:
                self._part.replace(self._path)
            else:
                self.problem = "the video could not be written to its end; is the disk full?"
        self._part.unlink(missing_ok=True)

    def take(self, env: Any) -> None:
        """Add a picture, unless drawing or writing has turned out to be impossible."""
        if self.problem:
            return
        try:
            picture = env.render()
        except RenderingUnavailable as error:
            self.problem = str(error)
            return
        try:
            self._add(picture)
        except OSError as error:  # its text is FFmpeg's whole output
            self.problem = f"the video could not be written ({error.strerror or 'FFmpeg failed'}); is the disk full?"

    def _add(self, picture: Any) -> None:
        if self._writer is None:
            import imageio

            options = {"fps": FRAMES_PER_SECOND, "codec": "libx264", "quality": 7, "macro_block_size": 8}
            self._writer = imageio.get_writer(self._part, format="FFMPEG", **options)
        self._writer.append_data(picture)
        self._count += 1

    def _end(self) -> None:
        if self._writer is None:
            return
        try:
            self._writer.close()
        except OSError as error:
            self.problem = self.problem or f"the video could not be written ({error.strerror or 'FFmpeg failed'})"

    def _readable_pictures(self) -> int:
        """How many pictures the file holds; FFmpeg does not say when it could not write its end."""
        from imageio_ffmpeg import count_frames_and_secs

        try:
            return count_frames_and_secs(self._part)[0] or 0
        except (OSError, RuntimeError):
            return 0
