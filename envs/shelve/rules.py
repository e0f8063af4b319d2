"""Rules of shelving, as data: tolerances and wanted contacts."""

from __future__ import annotations

import math

import numpy as np

from ..judge.goal_progress import GoalProgress, GoalRules, contacts, goal_row
from ..judge.judge import MEASURE
from ..scene.scene import FINGERS, FIRST_OBJECT, FURNITURE, WORLD
from .parts import CLUTTER

MAX_OFFSET, MAX_ANGLE = 0.010, np.deg2rad(5.0)
"""Tolerances of a book in its slot [m, rad]."""
WITHDRAWN = 0.15
"""Distance of the tcp to every shelved book's center from which the hand counts as withdrawn [m]."""
LOST = 0.04
"""Distance from its slot beyond which a book that was lifted and is at rest was dropped [m]."""
PUSHED, PUSHED_OVER = 0.05, np.deg2rad(15.0)
"""Displacement and turn beyond which a clutter book counts as pushed over [m, rad]."""


def shelve_rules(n: int) -> GoalRules:
    """Return the rules for n books, of which the first is handed over.

    Wanted contacts are books on and in furniture, waiting books on the table and on each other, clutter beside clutter,
    and the fingers on the book that is being fetched, is held or was released last.
    """
    books, count = range(FIRST_OBJECT, FIRST_OBJECT + n), n + len(CLUTTER)
    every = range(FIRST_OBJECT, FIRST_OBJECT + count)
    wanted = [(FURNITURE, each) for each in every] + [(FINGERS, book) for book in books]
    wanted += [(WORLD, book) for book in books[1:]]
    wanted += [(low, high) for part in (books[1:], every[n:]) for low in part for high in part if low < high]
    return GoalRules(
        rows=np.array([goal_row(k, lost=LOST, distance=MAX_OFFSET, angle=MAX_ANGLE) for k in range(n)]),
        stays=np.array([[math.inf, math.inf]] * n + [[PUSHED, PUSHED_OVER]] * len(CLUTTER)),
        allowed=contacts(count, wanted),
        withdrawn=WITHDRAWN,
        words=("book", "shelved"),
        numbers={"position_error": MEASURE.distance, "angle_error": MEASURE.angle},
        disturbed="clutter_pushed_over",
    )


def hand_over(progress: GoalProgress, k: int, pose: np.ndarray) -> None:
    """Note that a book now lies on the stand: it no longer waits on the table, with the other books.

    Args:
        progress: of the episode.
        k: index of the book.
        pose: (7,) its pose.
    """
    progress.put(k, pose)
    book = FIRST_OBJECT + k
    for low, high in ((WORLD, book), *((book, other) for other in range(book + 1, FIRST_OBJECT + len(progress.goals)))):
        progress.allowed[low, high] = 0.0
