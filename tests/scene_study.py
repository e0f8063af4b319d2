"""How many random scenes are solved, how fast, and whether the judge agrees: `python tests/scene_study.py --help`."""

from __future__ import annotations

import argparse
import json
import time
from collections import Counter
from pathlib import Path

import numpy as np
from helpers.random_scenes import KINDS, feasible, judged, problem, solve


def study(kind: str, seeds: range, *, unlimited: bool = True) -> dict:
    """The figures of a kind.

    Args:
        kind: of the scenes.
        seeds: one per scene.
        unlimited: look with hundreds of times the effort whether what was not solved can be solved.
    """
    spent, busy, ways, unsound, failed = [], [], Counter(), [], []
    for seed in seeds:
        scene = problem(kind, seed)
        begun = time.thread_time()
        plan = solve(scene)
        busy.append(1e3 * (time.thread_time() - begun))
        spent.append(1e3 * plan.seconds)
        ways[plan.how or plan.reason] += 1
        if not plan.success:
            failed.append(seed)
            continue
        certificate = judged(scene, plan)
        if not certificate.ok:
            unsound.append({"seed": seed, "reasons": certificate.reasons})
    proven = [seed for seed in failed if unlimited and feasible(problem(kind, seed))]
    solved = len(seeds) - len(failed)
    return {
        "n": len(seeds),
        "solved": solved,
        "unsound": len(unsound),
        "unsolved_though_feasible": len(proven),
        "no_way_known": len(failed) - len(proven),
        "share_of_feasible": round(solved / (solved + len(proven)), 4) if solved + len(proven) else None,
        "median_ms": round(float(np.median(spent)), 2),
        "p99_ms": round(float(np.quantile(spent, 0.99)), 1),
        "median_cpu_ms": round(float(np.median(busy)), 2),
        "p99_cpu_ms": round(float(np.quantile(busy, 0.99)), 1),
        "max_ms": round(max(spent), 1),
        "ways": dict(sorted(ways.items())),
        "seeds": [seeds.start, seeds.stop],
        "unsolved_seeds": failed,
        "unsound_seeds": unsound,
    }


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--count", type=int, default=50, help="scenes per kind")
    parser.add_argument("--first", type=int, default=0, help="first seed")
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--output", type=Path, help="JSON file to write")
    options = parser.parse_args()
    solve(problem("convex", 0)), solve(problem("cage", 0))  # compiled
    table = {}
    for kind in options.kinds.split(","):
        table[kind] = study(kind, range(options.first, options.first + options.count))
        print(kind, json.dumps(table[kind]), flush=True)
        if options.output is not None:
            options.output.write_text(json.dumps(table, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
