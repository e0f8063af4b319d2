"""The paper's experiments as data: config and overrides, what the paper did, and what differs here.

Paper: section IV. It prints no success rates, no sizes of the obstacles, and no units for some of its times.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

from ...planner.errors import UnknownName

EPISODES = 10
"""Number of seeds per experiment."""


@dataclass(frozen=True, slots=True)
class Experiment:
    """Task repeated over several seeds.

    Attributes:
        name: short name.
        title: title for headings.
        config: name of a shipped config.
        overrides: `key=value` changes to it.
        episodes: number of seeds.
        paper: the experiment in the paper.
        here: differences from the paper, whatever the result.
    """

    name: str
    title: str
    config: str
    overrides: tuple[str, ...]
    episodes: int
    paper: str
    here: str


@dataclass(frozen=True, slots=True)
class Drawing:
    """Escape trees in shipped scenes, drawn with all their planes and timed.

    Attributes:
        name: short name.
        title: title for headings.
        scenes: names of shipped scenes.
        repeats: number of time samples per tree.
        paper: the content of the paper.
        here: differences from the paper.
    """

    name: str
    title: str
    scenes: tuple[str, ...]
    repeats: int
    paper: str
    here: str


REAL = "the robot is simulated, there real"
EXPERIMENTS = (
    Experiment(
        name="pour",
        title="Pouring",
        config="pour",
        overrides=("level=L2", "obstacles=none"),
        episodes=EPISODES,
        paper="A real Panda pours water from one glass into another after one demonstration.",
        here=f"{REAL}; thirty beads stand for the water; a script gave the demonstration",
    ),
    Experiment(
        name="pour_obstacles",
        title="Pouring round obstacles",
        config="pour",
        overrides=("level=L2", "obstacles=static"),
        episodes=EPISODES,
        paper="The same with obstacles that the demonstration did not have.",
        here=f"{REAL}; beads for water; one to three still bodies of 3 to 10 cm are drawn anew for every seed",
    ),
    Experiment(
        name="stack",
        title="Stacking in five motions, something moves in front of the last block",
        config="stack",
        overrides=("level=L2", "obstacles=paper", "env.n_blocks=3"),
        episodes=EPISODES,
        paper="Three wooden blocks in five motions from the demonstration of one; a dynamic obstacle comes in front of "
        "the third block.",
        here=f"{REAL}; the demonstration is a person's teleoperation; the obstacle swings at up to 0.1 m/s, a speed "
        "that the paper does not print",
    ),
    Experiment(
        name="shelve",
        title="Shelving three books",
        config="shelve",
        overrides=("level=L2", "obstacles=none"),
        episodes=EPISODES,
        paper="Books are put side by side into the upper part of a cluttered shelf, the demonstration was given in the "
        "lower one.",
        here=f"{REAL}; a script gave the demonstration; the slots are 70 mm apart, so that fingers fit between books",
    ),
    Experiment(
        name="shelve_one",
        title="Shelving, one unforeseen obstacle",
        config="shelve",
        overrides=("level=L2", "obstacles=appear"),
        episodes=EPISODES,
        paper="An obstacle that was not there in the demonstration appears while a book is carried.",
        here=f"{REAL}; a body of 3 to 10 cm appears during a carry that is drawn for every seed",
    ),
    Experiment(
        name="shelve_two",
        title="Shelving, two unforeseen obstacles",
        config="shelve",
        overrides=("level=L2", "obstacles=paper"),
        episodes=EPISODES,
        paper="Two obstacles of different size appear while the second and the third book are placed.",
        here=f"{REAL}; the obstacles measure 6 and 9 cm, sizes that the paper does not print",
    ),
    Experiment(
        name="bimanual",
        title="From one arm to two",
        config="bimanual_pour",
        overrides=("level=L2",),
        episodes=EPISODES,
        paper="The Panda's demonstration of pouring is done by both arms of a Baxter.",
        here=f"{REAL}; beads for water; both arms share the way, the left hand does not turn, so that its glass stays "
        "upright",
    ),
    Drawing(
        name="tree",
        title="Escape trees and their tangent planes",
        scenes=("sphere", "wall_gap", "shelf", "clutter"),
        repeats=200,
        paper="A picture of a tree with its planes; 0.0429 +- 0.0109 ms for a level of it, in C++.",
        here="what is kept clear is the whole hand, there a point; every edge is proven; compiled Python, there C++",
    ),
)


def experiments_named(names: Iterable[str]) -> list[Experiment | Drawing]:
    """Return the experiments with these names, in the order of `EXPERIMENTS`; all of them if there are no names.

    Raises:
        UnknownName: an unknown name; the message lists all names.
    """
    known = {each.name: each for each in EXPERIMENTS}
    wanted = list(names)
    for name in wanted:
        if name not in known:
            raise UnknownName("experiment", name, known)
    return [each for each in EXPERIMENTS if not wanted or each.name in wanted]
