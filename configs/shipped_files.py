"""Files installed with the package."""

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
    """Return the file of a shipped demonstration, like "stack".

    Raises:
        UnknownName: no such demonstration; the message lists the known ones.
    """
    return _shipped("demonstration", "demos", ".npz", name)


def shipped_demonstrations() -> tuple[str, ...]:
    """Return the names of all shipped demonstrations."""
    return tuple(sorted(path.stem for path in (FOLDER / "demos").glob("*.npz")))


def shipped_config(name: str) -> Path:
    """Return the file of a shipped benchmark config, like "stack".

    Raises:
        UnknownName: no such config; the message lists the known ones.
    """
    return _shipped("config", "bench", ".yaml", name)


def shipped_training(name: str) -> Path:
    """Return the file of a shipped training config, like "reach_sac".

    Raises:
        UnknownName: no such training config; the message lists the known ones.
    """
    return _shipped("training", "train", ".yaml", name)


def shipped_robots(name: str) -> Path:
    """Return the file of a shipped list of robots, like "public".

    Raises:
        UnknownName: no such list; the message lists the known ones.
    """
    return _shipped("list of robots", "robots", ".yaml", name)


def shipped_actor(name: str) -> Path:
    """Return the .json file of a shipped actor, like "sac-stack-Panda".

    Raises:
        UnknownName: no such actor; the message lists the known ones.
    """
    return _shipped("actor", "actors", ".json", name)


def is_shipped(path: Path) -> bool:
    """Return whether a file was installed with the package."""
    return path.resolve().is_relative_to(FOLDER.resolve())


def demonstration_path(name: str) -> Path:
    """Return the named file if the name looks like a file, else the shipped demonstration of this name.

    Raises:
        UnknownName: neither a file nor a shipped demonstration.
    """
    path = Path(name)
    looks_like_a_file = path.suffix or path.is_file() or len(path.parts) > 1
    return path if looks_like_a_file else shipped_demonstration(name)
