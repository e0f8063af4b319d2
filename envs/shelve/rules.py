"""The rules of shelving: progress, success, wanted contacts, dense reward, from the simulator's state only.

The numbers are judged in compiled code, see `state`; `ShelveProgress` keeps what they came to.
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
"""A book is in its slot within these [m, rad]."""
STILL = 0.01
"""A book slower than this is at rest [m/s]."""
WITHDRAWN = 0.15
"""Distance of the tcp to every shelved book's center from which on the hand has withdrawn [m]."""
LOST = 0.04
"""A book that was lifted and now rests farther than this from its slot was dropped [m]."""
LOWEST = TABLE_HEIGHT - 0.05
"""A book whose center is below this has fallen off the table [m]."""
LIFTED = 0.02
"""Height above the stand at which a book counts as lifted [m]."""
PUSHED, PUSHED_OVER = 0.05, np.deg2rad(15.0)
"""A clutter book that was moved or turned by more than this was pushed over [m, rad]."""


class ShelveVerdict(NamedTuple):
    """What the compiled judge says of a state; counts and flags as whole numbers.

    Attributes:
        placed: books in their slots, from the first on.
        held: the next book is in the hand.
        raised: and is lifted.
        settled: all books are in their slots and at rest, and the hand has withdrawn.
        lost: a book that was lifted rests elsewhere.
        fallen: a book is off the table.
        toppled: a clutter book was pushed over.
        unwanted: pairs that touch and should not.
        low: the smaller owner of the last of them, or -1.
        high: the other owner.
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
    """Of two points, or of two poses' places [m]."""
    return math.sqrt((a[0] - b[0]) ** 2 + (a[1] - b[1]) ** 2 + (a[2] - b[2]) ** 2)


@kernel
def turn(a, b):
    """Angle between two poses (7,) [rad]."""
    cosine = abs(a[3] * b[3] + a[4] * b[4] + a[5] * b[5] + a[6] * b[6])
    return 2.0 * math.acos(min(1.0, cosine))


@kernel
def allowed_contact(low, high, placed, handed, n):
    """Whether two owners may touch: see WORLD in `scene` for their numbers, the smaller first.

    Wanted are books on and in furniture, books that wait on the table and on each other, clutter beside clutter,
    and the fingers on the book that is being fetched, held or was let go last.

    Args:
        low: smaller owner.
        high: other owner.
        placed: books in their slots.
        handed: books that were handed over; the ones after them wait.
        n: books to shelve; the objects after them are clutter.
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
    """Judge a state: the entries of a `ShelveVerdict`.

    Args:
        poses: (m, 7) books, then clutter.
        velocities: (m, 3) of them [m/s].
        tcp: (n_arms, 7) the tools.
        touching: (owners, owners) who touches whom, see `State`.
        goals: (n, 7) the slots of the books.
        start: (m, 7) where everything was; of a book where it was handed over.
        handed: number of books that were handed over.
        lifted: (n,) 1 once a book was lifted; renewed.
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
    """Dense reward in [0, 1]: the share of books shelved, and of the current one reached, grasped and carried."""
    n = len(goals)
    if placed == n:
        return 1.0
    reach = 1.0 - math.tanh(5.0 * distance(poses[placed], tcp[0]))
    carry = 1.0 - math.tanh(5.0 * distance(poses[placed], goals[placed]))
    part = 0.3 * reach + (0.1 + 0.5 * carry if held else 0.0)
    return (placed + part) / n


class ShelveProgress(Progress):
    """What has happened in an episode so far, renewed from the simulator's state at each step.

    Args:
        goals: (n, 7) the slots of the books.
        start: (m, 7) where books and clutter are at the start.
        dt: seconds between states.
        in_hand: the first book is in the hand from the start.
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
        """2k while book k is to be fetched, 2k + 1 while it is held."""
        return float(2 * self.placed + self.held)

    @property
    def failed(self) -> bool:
        """A book is off the table."""
        return self._failure == "off_table"

    @property
    def stage(self) -> str:
        """The furthest progress in words."""
        return self._stages[self._best_stage]

    @property
    def failure(self) -> str:
        """Why it cannot succeed as things are, "" if it can."""
        return self._failure

    def hand_over(self, pose: np.ndarray) -> None:
        """The next book now lies at a pose (7,) on the stand."""
        self._start[self.handed] = pose
        self.handed += 1

    def update(self, state: State) -> ShelveVerdict:
        """Take in a new state."""
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
        """The dense reward of the state taken in last."""
        return shaped(state.object_pose, self._goals, state.tcp_pose, self.placed, self.held)

    def task_info(self) -> dict[str, Any]:
        """The task's own entries of `info`."""
        return {
            "books_placed": self.placed,
            "position_error": self._errors[0],
            "angle_error": self._errors[1],
            "clutter_pushed_over": self.toppled,
        }


def stage_name(best: int, n_books: int) -> str:
    """The furthest progress in words."""
    if best == 0:
        return "start"
    if best % 2:
        return f"lifted book {best // 2 + 1} of {n_books}"
    return f"shelved {best // 2} of {n_books}"
