"""Facts about shelving, and about inserting a single book."""

from __future__ import annotations

from ..facts.task_facts import SegmentPlayback, TaskFacts, TaskPage

INSERTED = {"insertion_offset": "position_error", "insertion_angle": "angle_error"}
NUMBERS = "`books_placed`, `position_error` (n,) [m], `angle_error` (n,) [rad], `clutter_pushed_over`"
OBJECTS = "the books, then the clutter; a book's x points away from its spine, z along it"
FURNITURE = "cupboard, stand and the stand's foot; constant during an episode"
SHELF = '"upper" or "lower"; the demonstration was given in the lower one'
PLACES = {
    "cupboard_pose": "(7,)",
    "slots": "shift along the shelf [m]",
    "clutter": "(5, 2): gaps [m] from neighbor or wall, and from the front",
}

SHELVE = TaskFacts(
    "shelve",
    "onedemo/Shelve-v0",
    "onedemo.envs.shelve.shelve_env:shelve_env",
    90.0,
    TaskPage(
        summary="Shelve three books in the upper shelf of a cluttered cupboard, with one arm.",
        description="""\
A cupboard with two shelves stands on a table, turned so that the robot reaches it: for the Panda, books go in along a
yaw of about 75 degrees; other books stand in it. Three books (160 x 220 x 35 mm, 0.3 kg) are handed over one at a
time on a stand at about shelf height, lying, spine over its edge. They must be put upright, spine to the front, into
three slots 70 mm apart. Only friction holds them between the fingers.

A human would hand the books over; the environment plays this part: later books wait in a pile on the table. Once a
book is in its slot and released, and the whole robot is 8 cm away from the next book's place on the stand, the next
book moves from the pile to the stand at once. The robot never touches a book that is moved like this. Everything else
is physics.

Success is judged from the simulator: for half a second every book is within 10 mm and 5 degrees of its slot, touched
by no finger and at rest, the hand has withdrawn by 15 cm, and no clutter book was moved by more than 5 cm or turned
by more than 15 degrees.""",
        dense="the completed share of the task, including reaching, grasping and carrying of the current book",
        start="""\
L0 the nominal places; L1 the stand moved by up to 4 cm, 5 cm lower to 2.5 cm higher, turned by up to 10 degrees, the
cupboard by up to 1 cm and 5 degrees, the slots by up to 15 mm along the shelf, books by up to 3 mm and 2 degrees on
the stand, start joints by up to 0.05 rad; L2 up to 8 cm, 10 cm lower to 5 cm higher, 15 degrees, 2 cm and 15 degrees,
30 mm, 5 mm and 4 degrees, 0.1 rad. Each robot has its own nominal places.""",
        ends="when a book has fallen off the table",
        observed={
            "object_pose": OBJECTS,
            "goal_pose": "goal of each book",
            "furniture_pose": FURNITURE,
            "motion_index": "2k while book k is to be fetched, 2k + 1 while it is held, 2n when all are shelved",
        },
        numbers=NUMBERS,
        arguments={
            "robot": "those of `onedemo.envs.shelve.places.SHELF_PLACES`; of Baxter the right arm",
            "n_books": "number of books, 1 to 3",
            "shelf": SHELF,
            "obstacles": '"paper": two of different size appear while the last two books are carried',
        },
        options={
            "stand_pose": "(7,)",
            **PLACES,
            "books": "(n, 3): x, y [m] and yaw [rad] of each on the stand, from its middle",
        },
        blocked="the path of hand and book from the stand to the cupboard",
    ),
    task_metrics=INSERTED,
    compared_segment="insert",
    skill_at="onedemo.envs.shelve.skill:SHELVE_SKILL",
    recorder="onedemo.baselines.recording.record_shelve:record_shelve",
    recorded_in={"n_books": 1, "shelf": "lower"},
)

INSERT_ONE = TaskFacts(
    "insert_one",
    "onedemo/InsertOne-v0",
    "onedemo.envs.shelve.insert_one_env:insert_one_env",
    7.5,
    TaskPage(
        summary="Insert the book in the hand into its slot.",
        description="""\
A book (160 x 220 x 35 mm, 0.3 kg) is in the hand, upright, spine to the hand, 22 cm in front of its slot in a
cluttered cupboard, held only by friction between the fingers. It must be inserted and released, and the hand
withdrawn by 15 cm. Success is judged from the simulator as in `onedemo/Shelve-v0`: for half a second the book is
within 10 mm and 5 degrees of its slot, touched by no finger and at rest, and no clutter book was moved by more than 5
cm or turned by more than 15 degrees.""",
        dense="up to 0.75 for bringing the held book into its slot, from 0.75 to 1 for withdrawing then",
        start="""\
cupboard and clutter as in `onedemo/Shelve-v0`; the book moved by up to 1 cm and 3 degrees (L1) or 2 cm and 6 degrees
(L2) about the vertical. L0 is the nominal place.""",
        ends="when a book has fallen off the table",
        observed={
            "object_pose": OBJECTS.replace("books", "book", 1),
            "goal_pose": "goal of the book",
            "furniture_pose": FURNITURE,
            "motion_index": "1 while the book is held, 0 while it is not, 2 when it is shelved",
        },
        numbers=NUMBERS,
        arguments={"robot": "those of `onedemo/Shelve-v0`", "shelf": SHELF},
        options={**PLACES, "joint_positions": "(7,), which the book follows"},
        goals="(8,): pose of the book, and 1 once it is released and the hand is 15 cm away, else 0; its slot and 1",
    ),
    frequency=20,
    task_metrics=INSERTED,
    compared_segment="insert",
    demonstrated_task="shelve",
    skill_at="onedemo.envs.shelve.skill:SHELVE_SKILL",
    playback=SegmentPlayback("insert", "at its goal", 0, {"withdraw": 0.2}),
)
