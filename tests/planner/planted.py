"""Bugs to plant in a copy of the planner, and whether the tests notice.

    python tests/planner/planted.py [name ...]

The copy lies in a folder of its own that Python finds first; its kernels run uncompiled, which is quicker than to
compile them for every bug.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

ROOT = Path(__file__).parents[2]


class Bug(NamedTuple):
    """A change of the source, and the test file and expression (as of pytest's -k) that must notice.

    Attributes:
        name: what it is.
        file: in the planner.
        old: text that stands there once.
        new: what it becomes.
        tests: file and names of tests, in the folder of this one.
    """

    name: str
    file: str
    old: str
    new: str
    tests: tuple[str, str]


SEARCH = ("proximity", "exhaustive or parallel_segments or within_the_rounding")
PLANE = ("proximity", "separating_plane or tangent_plane")
CUTOFF = ("proximity", "quick_query")
PAIR = ("proximity", "two_segments or two_capsules")
NEAR = ("clearance", "near_pairs or smallest_room")
MASKED = ("clearance", "masked_pairs")
ROWS = ("clearance", "bounds_are_the_derivatives")
ARMS = ("clearance", "bounds_of_two_arms")
WAY = ("clearance", "farther_than_its_bound or bound_of_one_joint or bound_grows")
STEP = ("clearance", "tunnel or small_ball or one_joint_bends or too_close_may_part or short_motion")
EDGE = ("clearance", "edge_past or edge_of_a_tool")
ROOM = ("repet", "first_blocked")
CLOSED = ("safety_layer", "closed_form or along_a_surface or rises")
GUARD = ("safety_layer", "jumped_over or margin_goes_before or too_close_is_left")
LIMITS = ("safety_layer", "limits_are_never or pushed or beyond_a_limit")
MOVING = ("safety_layer", "sphere")

BUGS = [
    Bug(
        "rounding radius dropped",
        "collision/proximity",
        "else length) - rows[k, 1], t, normal",
        "else length), t, normal",
        SEARCH,
    ),
    Bug(
        "rounding radius dropped from the quick query",
        "collision/proximity",
        "_from_capsule(rows, k, a, b)[1]) - rows[k, 1]",
        "_from_capsule(rows, k, a, b)[1])",
        CUTOFF,
    ),
    Bug(
        "world into shape turned the wrong way",
        "collision/proximity",
        "rows[k, 5] * x + rows[k, 8] * y + rows[k, 11] * z",
        "rows[k, 5] * x + rows[k, 6] * y + rows[k, 7] * z",
        SEARCH,
    ),
    Bug(
        "normal into world turned the wrong way",
        "collision/proximity",
        "rows[k, 5] * v[0] + rows[k, 6] * v[1] + rows[k, 7] * v[2]",
        "rows[k, 5] * v[0] + rows[k, 8] * v[1] + rows[k, 11] * v[2]",
        PLANE,
    ),
    Bug(
        "ball of the shape dropped from the cutoff",
        "collision/proximity",
        "far = reach + rows[k, 20]",
        "far = reach",
        CUTOFF,
    ),
    Bug("box search stopped early", "collision/proximity", "for _ in range(40):", "for _ in range(1):", SEARCH),
    Bug(
        "capsule end not looked at again",
        "collision/proximity",
        "t = clamped((s * da - pd) * (1.0 / max(dd, TINY)), 0.0, 1.0)",
        "t = 1.0 * t",
        SEARCH,
    ),
    Bug("cylinder hollow", "collision/proximity", "if r > radius else 0.0", "if r > 0.0 else 0.0", SEARCH),
    Bug(
        "segment end not looked at again",
        "collision/proximity",
        "t = clamped((uv * s - uw) / uu, 0.0, 1.0) if uu > 0.0 else 0.0",
        "t = 1.0 * t",
        PAIR,
    ),
    Bug(
        "distance of polytopes not proven",
        "collision/gjk",
        "proven = max(0.0, _dot(v, w) / length)",
        "proven = length",
        ("proximity", "proven_from_below"),
    ),
    Bug(
        "obstacle moves backwards",
        "collision/clearance",
        "p[0] - seconds * g[o, 17]",
        "p[0] + seconds * g[o, 17]",
        ("clearance", "later_means"),
    ),
    Bug("radius of the arm dropped", "collision/clearance", "a, b) - g[BODY + c, B_RADIUS]", "a, b)", NEAR),
    Bug(
        "radius dropped from near pairs", "collision/clearance", "            gap -= g[BODY + c, B_RADIUS]\n", "", NEAR
    ),
    Bug(
        "first pair of the robot left out",
        "collision/clearance",
        "for p in range(pair, pair + int",
        "for p in range(pair + 1, pair + int",
        NEAR,
    ),
    Bug(
        "last obstacle left out",
        "collision/clearance",
        "for k in range(int(g[HEADER, N_OBSTACLES])):\n        if all_beyond(g, WORLD",
        "for k in range(int(g[HEADER, N_OBSTACLES]) - 1):\n        if all_beyond(g, WORLD",
        NEAR,
    ),
    Bug(
        "margin of near pairs dropped",
        "collision/clearance",
        "c, k, gap, g[OBSTACLES + k, MARGIN], normal",
        "c, k, gap, 0.0, normal",
        NEAR,
    ),
    Bug(
        "ball about the arm too small",
        "collision/robot_arrays",
        "v * v + w * w) + g[BODY + c, B_BALL])",
        "v * v + w * w))",
        NEAR,
    ),
    Bug(
        "ball about a capsule without its radius", "collision/robot_arrays", "axis=1) + capsules[:, 6]", "axis=1)", NEAR
    ),
    Bug(
        "mask of the wrong obstacle",
        "collision/robot_arrays",
        "int(g[OBSTACLES + obstacle, MASK])",
        "int(g[OBSTACLES, MASK])",
        MASKED,
    ),
    Bug(
        "lever of the nearer end",
        "collision/clearance",
        "square = max(_lever_square(g, joint, a), _lever_square(g, joint, b))",
        "square = min(_lever_square(g, joint, a), _lever_square(g, joint, b))",
        WAY,
    ),
    Bug("lever does not grow", "collision/clearance", "(math.sqrt(square) + way)", "math.sqrt(square)", WAY),
    Bug("way of sliding joints dropped", "collision/clearance", "way += abs(step[joint])\n", "way += 0.0\n", WAY),
    Bug("bend dropped", "collision/clearance", "bend = 0.25 * turning * way", "bend = 0.0", STEP),
    Bug(
        "velocity of the obstacle dropped from the plane",
        "collision/clearance",
        "return dt * (g[o, 17] * normal[0]",
        "return 0.0 * (g[o, 17] * normal[0]",
        STEP,
    ),
    Bug(
        "velocity of the obstacle dropped from the way",
        "collision/clearance",
        "gap + gap_end - way - other >=",
        "gap + gap_end - way >=",
        STEP,
    ),
    Bug(
        "way of the arm dropped",
        "collision/clearance",
        "gap + gap_end - way - other >=",
        "gap + gap_end - other >=",
        STEP,
    ),
    Bug(
        "distance to keep dropped within a step",
        "collision/clearance",
        "other >= 2.0 * keep",
        "other >= 0.0 * keep",
        STEP,
    ),
    Bug(
        "plane moved to the wrong side", "collision/clearance", "min(gap, gap + forth -", "min(gap, gap - forth -", STEP
    ),
    Bug("speed of obstacles dropped from the reach", "collision/clearance", "way + dt * fastest)", "way)", STEP),
    Bug(
        "distance to keep dropped from the reach",
        "collision/clearance",
        "return keep + max(2.0 * way",
        "return max(2.0 * way",
        GUARD,
    ),
    Bug(
        "joints of the first arm for both",
        "collision/clearance",
        "return int(g[ARMS, 3 * int(g[BODY + c, 0])])",
        "return 0",
        ARMS,
    ),
    Bug("sign of the bound", "safety/barrier", "g[k, T]), normal, 1.0)", "g[k, T]), normal, -1.0)", ROWS),
    Bug("sign of the other capsule", "safety/barrier", "g[k, S]), normal, -1.0)", "g[k, S]), normal, 1.0)", ROWS),
    Bug(
        "joints in reversed order",
        "safety/barrier",
        "g[row, first + joint] += sign",
        "g[row, start + int(g[BODY + c, B_FRAME]) - joint] += sign",
        ROWS,
    ),
    Bug(
        "closest point at the wrong end",
        "safety/barrier",
        "_on_core(g, i, g[k, T])",
        "_on_core(g, i, 1.0 - g[k, T])",
        ROWS,
    ),
    Bug(
        "obstacle velocity with the wrong sign",
        "safety/barrier",
        "need += normal[0] * g[o, 17]",
        "need -= normal[0] * g[o, 17]",
        ROWS,
    ),
    Bug(
        "margin dropped from the bound",
        "safety/barrier",
        "(g[k, GAP] - g[k, KEEP] - g[SETTINGS, BUFFER])",
        "(g[k, GAP] - g[SETTINGS, BUFFER])",
        CLOSED,
    ),
    Bug("sign of the rate", "safety/barrier", "int(g[k, OTHER]), -alpha *", "int(g[k, OTHER]), alpha *", CLOSED),
    Bug(
        "sliding joint taken for a turning one",
        "safety/barrier",
        "if g[SLIDING, joint] == 0.0:\n            u, v, w = p[0] - g[f, 3]",
        "if g[SLIDING, joint] >= 0.0:\n            u, v, w = p[0] - g[f, 3]",
        ROWS,
    ),
    Bug(
        "limits swapped",
        "safety/barrier",
        "low if sign > 0.0 else -high",
        "low if sign < 0.0 else -high",
        ("clearance", "last_bounds"),
    ),
    Bug(
        "approach to limits unbounded",
        "safety/barrier",
        "min(g[SPEED, i], max(0.0, gain * (g[HIGH, i] - q[i])))",
        "g[SPEED, i]",
        LIMITS,
    ),
    Bug(
        "multipliers of the wrong sign",
        "safety/qp",
        "x[i] += t * z",
        "x[i] -= t * z",
        ("qp", "closed_form or quadprog"),
    ),
    Bug("slack forgotten", "safety/qp", "s = rows[i, SOFTNESS] if i == j else 0.0", "s = 0.0", ("qp", "soft")),
    Bug(
        "guard does not look between the ends",
        "safety/safety_layer",
        "if gentle and (whole or step_stays_clear(g, q, step[:n], dt)):",
        "if gentle:",
        GUARD,
    ),
    Bug(
        "guard does not look at all",
        "safety/safety_layer",
        "if gentle and (whole or step_stays_clear(g, q, step[:n], dt)):",
        "if True:",
        GUARD,
    ),
    Bug(
        "guard takes every whole step for clear",
        "safety/safety_layer",
        "whole = k == 0 and",
        "whole = k == 0 or",
        GUARD,
    ),
    Bug(
        "guard takes shorter steps for the whole one",
        "safety/safety_layer",
        "whole = k == 0 and placed_step_stays_clear(g, step[:n], 0.0, dt)",
        "whole = k > 0 or placed_step_stays_clear(g, step[:n], 0.0, dt)",
        GUARD,
    ),
    Bug("all bounds are taken to hold", "safety/barrier", "if all_hold(rows, count, x, n):", "if True:", CLOSED),
    Bug(
        "guard sends what it has refused",
        "safety/safety_layer",
        "                x[i] *= scale\n            return FREE",
        "                x[i] *= 1.0\n            return FREE",
        GUARD,
    ),
    Bug(
        "guard does not look beyond the shell",
        "safety/safety_layer",
        "if reach > g[SETTINGS, SHELL]:",
        "if reach < 0.0:",
        GUARD,
    ),
    Bug(
        "guard tries no step but the whole",
        "safety/safety_layer",
        "scale *= 0.5",
        "scale *= 1.0",
        ("safety_layer", "along_a_surface or jumped_over or margin_goes_before or closed_form or shrinks"),
    ),
    Bug(
        "not a number goes through",
        "safety/safety_layer",
        "qdot[i] if math.isfinite(qdot[i]) else 0.0",
        "qdot[i]",
        ("safety_layer", "absurd"),
    ),
    Bug(
        "blocked is hidden",
        "safety/safety_layer",
        "return BLOCKED if missed else status",
        "return min(status, HELD)",
        MOVING,
    ),
    Bug("slack ahead is not used up", "escape/detour", "        left -= way\n", "        left -= 0.0 * way\n", ROOM),
    Bug(
        "slack ahead is used once too often", "escape/detour", "if left <= way and not", "if left <= -way and not", ROOM
    ),
    Bug("slide goes on too far", "collision/edge_certificates", "s -= slack / slope", "s -= 3.0 * slack / slope", EDGE),
    Bug(
        "screw goes on too far",
        "collision/edge_certificates",
        "stretch = slack / speed",
        "stretch = 3.0 * slack / speed",
        EDGE,
    ),
    Bug(
        "turning dropped from a screw's speed",
        "collision/edge_certificates",
        "v[0] + u[0], v[1] + u[1], v[2] + u[2]",
        "v[0], v[1], v[2]",
        EDGE,
    ),
    Bug(
        "tangent plane left-handed",
        "escape/tangent_plane",
        "return screw.cross(v, normal), v",
        "return screw.cross(normal, v), v",
        ("proximity", "basis_of_a_plane"),
    ),
]


def copied(folder: Path, bug: Bug | None) -> None:
    """The planner, with the bug, as `onedemo.planner` in a folder."""
    package = folder / "onedemo"
    package.mkdir()
    (package / "__init__.py").touch()
    shutil.copytree(ROOT / "planner", package / "planner", ignore=shutil.ignore_patterns("__pycache__"))
    if bug is not None:
        file = package / "planner" / f"{bug.file}.py"
        text = file.read_text(encoding="utf-8")
        if text.count(bug.old) != 1:
            raise LookupError(f"{bug.name}: the text stands {text.count(bug.old)} times in {bug.file}.py")
        file.write_text(text.replace(bug.old, bug.new), encoding="utf-8")


def run_tests(bug: Bug | None, tests: Sequence[tuple[str, str]]) -> tuple[int, str]:
    """Exit status and output of pytest on a copy: 0 if all pass, 1 if one fails."""
    with tempfile.TemporaryDirectory() as folder:
        copied(Path(folder), bug)
        settings = {"PYTHONPATH": folder, "NUMBA_DISABLE_JIT": "1", "ONEDEMO_SOAK": "0.01", "NUMBA_CACHE_DIR": folder}
        output = ""
        for stem, names in tests:
            (file,) = Path(__file__).parent.glob(f"**/test_{stem}.py")
            call = [sys.executable, "-m", "pytest", "-x", "-q", "-p", "no:cacheprovider", str(file), "-k", names]
            done = subprocess.run(call, cwd=ROOT, env={**os.environ, **settings}, capture_output=True, text=True)
            output += done.stdout
            if done.returncode:
                return done.returncode, output
    return 0, output


def main() -> int:
    wanted = set(sys.argv[1:])
    if not wanted:
        status, output = run_tests(None, sorted({bug.tests for bug in BUGS}))
        print("an unchanged copy passes" if status == 0 else output, flush=True)
    missed = []
    for bug in BUGS:
        if not wanted or bug.name in wanted:
            status, output = run_tests(bug, [bug.tests])
            failed = [line for line in output.splitlines() if line.startswith("FAILED")]
            word = "caught" if status == 1 else "MISSED"
            print(f"{word}  {bug.file:10s} {bug.name}  {''.join(failed)[:90]}", flush=True)
            missed += [bug.name] if status != 1 else []
    print(f"{len(missed)} missed")
    return bool(missed)


if __name__ == "__main__":
    sys.exit(main())
