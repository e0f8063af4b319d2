"""Rules of shelving: progress, success, wanted contacts, dense reward, from the simulator's state only.

Compiled code judges the numbers, see `state`; `ShelveProgress` keeps the results.
"""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np

from ...planner.jit import kernel
from ..core.progress import Progress
from ..scene.scene import ARM, FINGERS, FIRST_OBJECT, FURNITURE, WORLD
from ..scene.scene_objects import TABLE_HEIGHT
from ..simulation.state import State

MAX_OFFSET, MAX_ANGLE = 0.010, np.deg2rad(5.0)
"""Tolerances of a book in its slot [m, rad]."""
STILL = 0.01
"""Speed below which a book counts as at rest [m/s]."""
WITHDRAWN = 0.15
"""Distance of the tcp to every shelved book's center from which the hand counts as withdrawn [m]."""
LOST = 0.04
"""Distance from its slot beyond which a book that was lifted and is at rest was dropped [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""Height (z) of a book's center below which the book has fallen off the table [m]."""
LIFTED = 0.02
"""Height above the stand from which a book counts as lifted [m]."""
PUSHED, PUSHED_OVER = 0.05, np.deg2rad(15.0)
"""Displacement and turn beyond which a clutter book counts as pushed over [m, rad]."""


class ShelveVerdict(NamedTuple):
    """Verdict of the compiled judge on a state; counts and flags are whole numbers.

    Attributes:
        placed: number of books in their slots, counted from the first.
        held: whether the next book is in the hand.
        raised: whether it was also lifted.
        settled: whether all books are in their slots and at rest, and the hand has withdrawn.
        lost: whether a book was lifted and now rests elsewhere.
        fallen: whether a book is off the table.
        toppled: whether a clutter book was pushed over.
        unwanted: number of pairs in unwanted contact.
        low: smaller owner of the last such pair, or -1.
        high: larger owner of the last such pair, or -1.
    """

    placed: int
    held: int
    raised: int
    settled: int
    lost: int
    fallen: int
    toppled: int
    unwanted: int
    low: int
    high: int


@kernel
def distance(a, b):
    """Return the distance [m] of two points or poses.

    Args:
        a: (3,) point, or (7,) pose of which only the position counts.
        b: (3,) point or (7,) pose, likewise.
    """
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def turn(a, b):
    """Return the angle between two poses [rad].

    Args:
        a: (7,) pose, x y z [m] and wxyz.
        b: (7,) pose, likewise.
    """
    cosine = abs(a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6])
    return 2.0 * math.acos(min(1.0, cosine))


@kernel
def allowed_contact(low, high, placed, handed, n):
    """Return whether two owners may touch.

    Wanted contacts are books on and in furniture, waiting books on the table and on each other, clutter beside clutter,
    and the fingers on the book that is being fetched, is held or was released last.

    Args:
        low: smaller owner, see `WORLD` in `scene`.
        high: larger owner.
        placed: number of books in their slots.
        handed: number of books handed over; the later ones wait.
        n: number of books to shelve; later objects are clutter.
    """
    if low == high or (low == ARM and high == FINGERS):
        return True
    if high < FIRST_OBJECT or low == ARM:
        return False
    book = high - FIRST_OBJECT
    if low == FURNITURE:
        return True
    if low == WORLD:
        return handed <= book < n
    if low == FINGERS:
        return book < n and (book == placed or book == placed - 1)
    other = low - FIRST_OBJECT
    return other >= 0 and (handed <= other < book < n or other >= n)


@kernel
def judge_state(poses, velocities, tcp, touching, goals, start, handed, lifted, errors):
    """Judge a state; return the entries of a `ShelveVerdict`.

    Args:
        poses: (m, 7) poses of books, then clutter, x y z [m] and wxyz.
        velocities: (m, 3) their velocities [m/s].
        tcp: (n_arms, 7) tcp poses.
        touching: (owners, owners) contacts, see `State`.
        goals: (n, 7) slots of the books.
        start: (m, 7) initial poses; of a book its pose when handed over.
        handed: number of books handed over.
        lifted: (n,) 1 once a book was lifted; updated.
        errors: (2, n) result: distance [m] and angle [rad] of each book to its slot.
    """
    n, placed, counting, quiet, lost, fallen, toppled = len(goals), 0, True, True, False, False, False
    for k in range(len(poses)):
        pose = poses[k]
        still = math.sqrt(velocities[k, 0] ** 2 + velocities[k, 1] ** 2 + velocities[k, 2] ** 2) < STILL
        quiet = quiet and still
        fallen |= pose[2] < LOWEST
        if k >= n:
            toppled |= distance(pose, start[k]) > PUSHED or turn(pose, start[k]) > PUSHED_OVER
            continue
        errors[0, k], errors[1, k] = distance(pose, goals[k]), turn(pose, goals[k])
        in_hand = touching[FINGERS, FIRST_OBJECT + k] != 0.0
        in_slot = errors[0, k] <= MAX_OFFSET and errors[1, k] <= MAX_ANGLE and not in_hand
        counting = counting and in_slot
        placed += counting
        quiet = quiet and distance(pose, tcp[0]) >= WITHDRAWN
        if in_hand and pose[2] > start[k, 2] + LIFTED:
            lifted[k] = 1.0
        lost |= lifted[k] != 0.0 and still and not in_hand and errors[0, k] > LOST
    held = placed < n and touching[FINGERS, FIRST_OBJECT + placed] != 0.0
    raised = held and lifted[placed] != 0.0
    unwanted, low, high = 0, -1, -1
    for a in range(len(touching)):
        for b in range(a, len(touching)):
            if touching[a, b] != 0.0 and not allowed_contact(a, b, placed, handed, n):
                unwanted, low, high = unwanted + 1, a, b
    done = placed == n and quiet and not toppled
    flags = (int(held), int(raised), int(done), int(lost), int(fallen), int(toppled))
    return placed, *flags, unwanted, low, high


@kernel
def shaped(poses, goals, tcp, placed, held):
    """Return the dense reward in [0, 1]: share of books shelved, and of the current one reached, grasped and carried.

    Args:
        poses: (m, 7) poses of books, then clutter, x y z [m] and wxyz.
        goals: (n, 7) slots of the books.
        tcp: (n_arms, 7) tcp poses.
        placed: number of books in their slots.
        held: whether the next book is in the hand.
    """
    n = len(goals)
    if placed == n:
        return 1.0
    reach = 1.0 - math.tanh(5.0 * distance(poses[placed], tcp[0]))
    carry = 1.0 - math.tanh(5.0 * distance(poses[placed], goals[placed]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if held else 0.0)
    return (placed + part) / n


class ShelveProgress(Progress):
    """Progress of shelving, updated from the simulator's state at each step.

    Args:
        goals: (n, 7) slots of the books, x y z [m] and wxyz.
        start: (m, 7) poses of books and clutter at the start.
        dt: time between states [s].
        in_hand: whether the first book is in the hand from the start.
    """

    def __init__(self, goals: np.ndarray, start: np.ndarray, dt: float, *, in_hand: bool = False):
        super().__init__(dt)
        self.n_books = len(goals)
        self._goals, self._start = goals, start.copy()
        self._lifted = np.zeros(self.n_books)
        self._lifted[0] = float(in_hand)
        self._errors = np.zeros((2, self.n_books))
        self._best_stage = 0
        self._stages = [stage_name(best, self.n_books) for best in range(2 * self.n_books + 1)]
        self.placed = 0
        self.handed = 1
        self.held = False
        self.toppled = False
        self._failure = ""

    @property
    def motion_index(self) -> float:
        """Index of the current motion: 2k while fetching book k, 2k + 1 while holding it."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """True once a book is off the table."""
        return self._failure == "off_table"

    @property
    def stage(self) -> str:
        """Furthest progress in words."""
        return self._stages[self._best_stage]

    @property
    def failure(self) -> str:
        """Reason why the task cannot succeed at present, "" if it can."""
        return self._failure

    def hand_over(self, pose: np.ndarray) -> None:
        """Register that the next book now lies at a pose (7,) on the stand."""
        self._start[self.handed] = pose
        self.handed += 1

    def update(self, state: State) -> ShelveVerdict:
        """See `Progress`."""
        self._errors = np.empty((2, self.n_books))
        poses, moving, tcp = state.object_pose, state.object_velocity, state.tcp_pose
        known = (self._goals, self._start, self.handed, self._lifted, self._errors)
        verdict = ShelveVerdict(*judge_state(poses, moving, tcp, state.touching, *known))
        self.placed, self.held, self.toppled = verdict.placed, verdict.held == 1, verdict.toppled == 1
        self._settle(verdict.settled == 1, verdict)
        self._best_stage = max(self._best_stage, 2 * verdict.placed + verdict.raised)
        rules = (("off_table", verdict.fallen), ("dropped", verdict.lost), ("constraint", verdict.toppled))
        self._failure = next((name for name, broken in rules if broken), "")
        return verdict

    def reward(self, state: State) -> float:
        """See `Progress`."""
        return shaped(state.object_pose, self._goals, state.tcp_pose, self.placed, self.held)

    def task_info(self) -> dict[str, Any]:
        """See `Progress`."""
        return {
            "books_placed": self.placed,
            "position_error": self._errors[0],
            "angle_error": self._errors[1],
            "clutter_pushed_over": self.toppled,
        }


def stage_name(best: int, n_books: int) -> str:
    """Return the furthest progress in words.

    Args:
        best: 2 for each book shelved, plus 1 if the next one was lifted.
        n_books: number of books.
    """
    if best == 0:
        return "start"
    if best % 2:
        return f"lifted book {best // 2 + 1} of {n_books}"
    return f"shelved {best // 2} of {n_books}"
