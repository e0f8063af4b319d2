"""Selection and file names of failure videos: the first failure of each kind of each method."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import dataclass, replace
from pathlib import Path

from ..document.untrusted_text import link_to, slug
from .episode_records import EpisodeRecord

FOLDER, FILMED = "videos", "videos.json"
MOST = 12
"""Default of the largest number of videos per run."""
NAME = re.compile(r"([0-9a-f]{12})-([0-9]{1,7})-([0-9]{1,10})-([a-z0-9_-]{1,60})\.mp4")


@dataclass(frozen=True, slots=True)
class Video:
    """A video of a failure.

    Attributes:
        cell: digest of its cell.
        index: index of its scenario.
        seed: seed of its scenario.
        reason: reason of the failure, as in the file name.
        file: path relative to the run folder, or to a report.
    """

    cell: str
    index: int
    seed: int
    reason: str
    file: str


def chosen(records: Iterable[EpisodeRecord], most: int = MOST) -> list[EpisodeRecord]:
    """Return the first failure of each kind of each method, in turn over the methods so that each gets its share.

    Args:
        records: episodes of all cells.
        most: largest number of failures to return.
    """
    first: dict[tuple[str, str], EpisodeRecord] = {}
    for record in records:
        # an episode that killed or hung its worker would probably do so again
        if not record.success and not record.lost:
            first.setdefault((record.method, record.failure_reason), record)
    turns: dict[str, int] = {}
    ranked = []
    for record in first.values():
        turns[record.method] = turns.get(record.method, -1) + 1
        ranked.append((turns[record.method], record))
    return [record for _, record in sorted(ranked, key=lambda pair: pair[0])][:most]


def video_of(record: EpisodeRecord) -> Video:
    """Return the video of an episode, with its file name, whether or not the file exists."""
    reason = slug(record.failure_reason)
    name = f"{record.cell}-{record.index}-{record.seed}-{reason}.mp4"
    return Video(record.cell, record.index, record.seed, reason, f"{FOLDER}/{name}")


def videos_beside(folders: Iterable[Path], output: Path) -> list[Video]:
    """Return the videos of run folders with links relative to a report's folder.

    Args:
        folders: run folders; for an episode filmed in several folders, the first counts.
        output: folder of the report.
    """
    found: dict[tuple[str, int], Video] = {}
    for folder in folders:
        here = videos_in(folder)
        known = set(found)
        linked = {(v.cell, v.index): replace(v, file=link_to(folder / v.file, output)) for v in here}
        found |= {key: video for key, video in linked.items() if key not in known}
    return list(found.values())


def videos_in(folder: Path) -> list[Video]:
    """Return the videos in a run folder; files with other names are ignored."""
    found = []
    for path in sorted((folder / FOLDER).glob("*.mp4")):
        match = NAME.fullmatch(path.name)
        if match:
            cell, index, seed, reason = match.groups()
            found.append(Video(cell, int(index), int(seed), reason, f"{FOLDER}/{path.name}"))
    return found
