"""Replay of the first episode for its figure and its video."""

from __future__ import annotations

from contextlib import nullcontext
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ...baselines import LabeledPath, Policy
from ...baselines.programs.world_model import obstacles_in
from ...configs import RunConfig
from ...envs import TaskObject
from ...envs.errors import RenderingUnavailable
from ...planner import Obstacle, Pose
from .episode import run_episode
from .scenarios import Scenario

EVERY = 4
"""Control steps per picture."""
FRAMES_PER_SECOND = 25


@dataclass
class Showcase:
    """Observations of an episode for its figure and video.

    Attributes:
        objects: the movable objects.
        table_height: height of the table top [m].
        start: (n, 7) object poses at the start.
        goals: (n, 7) goal poses of the objects.
        end: (n, 7) object poses at the end.
        executed: (steps + 1, 3) positions of the tcp [m].
        paths: paths planned by the policy.
        furniture: fixed bodies.
        obstacles: by name, the last observation of each obstacle.
        traces: by name, the observed positions (3,) of each obstacle [m].
        speed: playback speed of the video relative to simulated time.
        video_problem: "" or the reason why there is no video.
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
    """Run a scenario and return the observations; also write a video if wanted and possible.

    Args:
        env: environment of the cell.
        policy: policy of the cell.
        scenario: start of the episode.
        config: config of the cell.
        video: file of the video (.mp4); None: no video.
    """
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
    """An mp4 written picture by picture; it gets its final name only once all of it can be read back.

    Used in a `with` statement: after an exception no file remains. `problem` is "" or the reason why there is no video.
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
        """Add a picture, unless rendering or writing has failed before."""
        if self.problem:
            return
        try:
            picture = env.render()
        except RenderingUnavailable as error:
            self.problem = str(error)
            return
        try:
            self._add(picture)
        except OSError as error:  # the error's text is FFmpeg's whole output
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
        """Return the number of pictures in the file; FFmpeg does not report that it could not write the end."""
        from imageio_ffmpeg import count_frames_and_secs

        try:
            return count_frames_and_secs(self._part)[0] or 0
        except (OSError, RuntimeError):
            return 0
