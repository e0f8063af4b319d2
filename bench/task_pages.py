"""`onedemo tasks`: list the environments, or write a documentation page of each."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from ..configs import BadConfig
from ..envs import TASKS
from .console import console, writing

CLIP_SIZE = (480, 360)
CLIP_SECONDS = 8.0
"""Duration of a clip; the playback speed follows from it."""
CLIP_FRAMES = 96
CLIP_QUALITY = 55
MOST_PICTURES = 300
"""Largest number of pictures rendered of an episode that takes its whole time limit."""


def list_tasks() -> None:
    """Print id, summary, time limit and shipped config of every environment."""
    from rich.table import Table

    table = Table(box=None, pad_edge=False, header_style="bold")
    for head in ("id", "what it is", "seconds", "config"):
        table.add_column(head, no_wrap=head == "id")
    for name, facts in TASKS.items():
        table.add_row(facts.id, facts.page.summary, f"{facts.seconds:g}", f"onedemo run {name}")
    console().print(table, soft_wrap=False)


def page_text(task: str) -> str:
    """Return the Markdown page of a task's environment: its docstring below its clip, if it has one."""
    import gymnasium as gym

    identifier = TASKS[task].id
    summary, _, rest = str(gym.make(identifier).unwrapped.__doc__).partition("\n\n")
    return "\n\n".join([
        f"# {identifier}",
        summary,
        f"![The planner at work on {identifier}]({task}.webp)",
        f'```python\nimport gymnasium as gym\nimport onedemo.envs\n\nenv = gym.make("{identifier}")\n```',
        rest,
        f"One run of the planner on it: `onedemo run {task}`.\n",
    ])  # fmt: skip


def own_page(path: str) -> str:
    """Return the Markdown page of a user's own task, given by its dotted path.

    Raises:
        BadConfig: no such module or name, or it is no task.
        BadTask: the task cannot be used.
    """
    from ..envs import task_at
    from ..envs.dotted_names import BadDottedName
    from ..envs.tasks.describe import described

    try:
        own = task_at(path)
        page = f"# {own.id}\n\n{own.summary}\n\n{described(own)}"
        return f"{page}\n\nOne run of the planner on it: `onedemo run {path}`."
    except BadDottedName as error:
        raise BadConfig(path, "", error.reason) from None


def write_own_pages(paths: list[str], folder: Path) -> list[Path]:
    """Write the page of each of a user's own tasks.

    Args:
        paths: dotted paths.
        folder: folder of the pages; made if missing.

    Returns:
        The files written.

    Raises:
        BadConfig: a file cannot be written, or a path names no task.
    """
    from ..envs import task_at

    written = []
    for path in paths:
        text, page = own_page(path), folder / f"{task_at(path).name}.md"
        with writing("--write", page):
            folder.mkdir(parents=True, exist_ok=True)
            page.write_text(text + "\n", encoding="utf-8")
        written.append(page)
    return written


def write_pages(folder: Path, *, clips: bool) -> list[Path]:
    """Write the page of every task, and its clip if wanted.

    Args:
        folder: folder of the pages; made if missing.
        clips: also record a clip for each page.

    Returns:
        The files written.

    Raises:
        BadConfig: a file cannot be written.
    """
    written = []
    for task in TASKS:
        page = folder / f"{task}.md"
        with writing("--write", page):
            folder.mkdir(parents=True, exist_ok=True)
            page.write_text(page_text(task), encoding="utf-8")
        written.append(page)
        if clips:
            written.append(write_clip(task, folder / f"{task}.webp"))
    return written


def write_clip(task: str, file: Path) -> Path:
    """Record a looping clip of the planner's first episode of a task's shipped config, of its first cell.

    Args:
        task: name of the task.
        file: the .webp to write.

    Returns:
        The file.

    Raises:
        BadConfig: the file cannot be written.
    """
    from ..configs import load_grid, shipped_config
    from .episodes.episode import run_episode
    from .episodes.scenarios import scenarios_of
    from .run.episode_jobs import made, policy_for

    config = load_grid(shipped_config(task)).cells[0]
    env = made(config, "rgb_array")
    policy = policy_for(env, config)
    pictures: list[Any] = []
    every = max(1, TASKS[task].steps // MOST_PICTURES)
    with writing("--write", file):
        run_episode(
            env, policy, scenarios_of(config)[0], config, lambda env, _: pictures.append(_picture(env, pictures, every))
        )
        env.close()
        _save(file, pictures)
    return file


def _picture(env: Any, before: list[Any], every: int) -> Any:
    """Return an image of every `every`-th state, None for the others."""
    from PIL import Image

    return Image.fromarray(env.render()).resize(CLIP_SIZE) if len(before) % every == 0 else None


def _save(file: Path, pictures: list[Any]) -> None:
    drawn = [picture for picture in pictures if picture is not None]
    step = max(1, round(len(drawn) / CLIP_FRAMES))
    kept = drawn[::step]
    pause = round(1000.0 * CLIP_SECONDS / len(kept))
    kept[0].save(file, save_all=True, append_images=kept[1:], duration=pause, loop=0, quality=CLIP_QUALITY, method=6)
