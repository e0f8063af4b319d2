"""The files that are installed with the package."""

from __future__ import annotations

from pathlib import Path

from ..planner.errors import UnknownName

FOLDER = Path(__file__).parent


def _shipped(kind: str, folder: str, suffix: str, name: str) -> Path:
    known = {path.stem: path for path in sorted((FOLDER / folder).glob(f"*{suffix}"))}
    if name not in known:
        raise UnknownName(kind, name, known)
    return known[name]


def shipped_demonstration(name: str) -> Path:
    """File of a demonstration that comes with the package, like "stack".

    Raises:
        UnknownName: there is none of that name; the message lists them.
    """
    return _shipped("demonstration", "demos", ".npz", name)


def shipped_config(name: str) -> Path:
    """File of a benchmark config that comes with the package, like "stack".

    Raises:
        UnknownName: there is none of that name; the message lists them.
    """
    return _shipped("config", "bench", ".yaml", name)


def shipped_training(name: str) -> Path:
    """File of a training config that comes with the package, like "reach_sac".

    Raises:
        UnknownName: there is none of that name; the message lists them.
    """
    return _shipped("training", "train", ".yaml", name)


def shipped_actor(name: str) -> Path:
    """The .json of an actor that comes with the package, like "sac-stack-Panda".

    Raises:
        UnknownName: there is none of that name; the message lists them.
    """
    return _shipped("actor", "actors", ".json", name)


def demonstration_path(name: str) -> Path:
    """The file itself if there is one of that name, else the shipped demonstration."""
    path = Path(name)
    looks_like_a_file = path.suffix or path.exists() or len(path.parts) > 1
    return path if looks_like_a_file else shipped_demonstration(name)
