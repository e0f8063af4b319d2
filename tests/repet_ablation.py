"""What each setting of REPET is worth: one at a time is changed, over the same random tools and obstacles.

    python tests/repet_ablation.py --count 30 --output bench/ablation.json

Per setting: problems solved, CPU time, and the length of the way over that of the default where both have found one.
"""

from __future__ import annotations

import argparse
import json
import time
from dataclasses import asdict, replace
from pathlib import Path

import numpy as np
from helpers.random_scenes import tool_problem

from onedemo.planner.escape.repet import RepetSettings, escape_path

KINDS = ("convex", "clutter", "gap", "trap", "shelf")
DEFAULT = RepetSettings()
PAPER = {"trigger": "shell", "basis": "world", "square": True, "cost": "goal", "shortcut": False, "retries": 0}
VARIANTS = {
    "default": {},
    "as the paper has it": PAPER,
    **{f"{key} = {value}": {key: value} for key, value in PAPER.items()},
    "distance = 0.01": {"distance": 0.01},
    "distance = 0.03": {"distance": 0.03},
    "shell = 0.03": {"shell": 0.03},
    "shell = 0.1": {"shell": 0.1},
    "step = 0.03": {"step": 0.03},
    "step = 0.12": {"step": 0.12},
    "levels = 5": {"levels": 5},
    "levels = 30": {"levels": 30},
    "beam = 4": {"beam": 4},
    "beam = 200": {"beam": 200},
    "orientation = spread": {"orientation": "spread"},
    "orientation = turn": {"orientation": "turn"},
    "random = 0": {"random": 0},
    "away = 0": {"away": 0.0},
    "grow = shrink = 1": {"grow": 1.0, "shrink": 1.0},
    "candidates = 1": {"candidates": 1},
    "cell = 0.25": {"cell": 0.25},
    "cell = 0.5": {"cell": 0.5},
    "nodes = 400": {"nodes": 400},
    "nodes = 20000": {"nodes": 20_000},
    "rounds = 1": {"rounds": 1},
    "pull_back": {"pull_back": True},
    "spacing = 0.03": {"spacing": 0.03},
    "bias upwards": {"bias": (0.0, 0.0, 0.5)},
}


def measured(settings: RepetSettings, count: int) -> list[tuple[bool, float, float]]:
    """Per problem: solved, CPU seconds, length of the way [m]."""
    found = []
    for kind in KINDS:
        for seed in range(count):
            path, tool, obstacles = tool_problem(kind, seed)
            start = time.process_time()
            escape = escape_path(path, tool, obstacles, settings, seed=seed)
            found.append((escape.found, time.process_time() - start, float(escape.path.lengths()[-1])))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description="What each setting of REPET is worth.")
    parser.add_argument("--count", type=int, default=30, help="problems per kind")
    parser.add_argument("--output", type=Path, default=Path("bench/ablation.json"))
    options = parser.parse_args()
    measured(DEFAULT, 1)
    rows, reference = [], measured(DEFAULT, options.count)
    for name, change in VARIANTS.items():
        found = measured(replace(DEFAULT, **change), options.count)
        ways = [one[2] / other[2] for one, other in zip(found, reference, strict=True) if one[0] and other[0]]
        seconds = np.array([one[1] for one in found])
        rows.append(
            {
                "setting": name,
                "change": change,
                "problems": len(found),
                "solved": sum(one[0] for one in found),
                "median_cpu_ms": round(1e3 * float(np.median(seconds)), 2),
                "p99_cpu_ms": round(1e3 * float(np.quantile(seconds, 0.99)), 1),
                "way_over_default": round(float(np.mean(ways)), 3),
            }
        )
        row = rows[-1]
        print(f"{name:24} {row['solved']:4} of {row['problems']}  {row['median_cpu_ms']:7.2f} ms  "
              f"{row['p99_cpu_ms']:7.1f} ms  way {row['way_over_default']:.3f}", flush=True)  # fmt: skip
    text = {"kinds": KINDS, "count": options.count, "default": asdict(DEFAULT), "rows": rows}
    options.output.write_text(json.dumps(text, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
