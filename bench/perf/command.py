"""`onedemo perf`: speeds as ratios within one run, since machines differ and are shared."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable
from dataclasses import asdict
from fnmatch import fnmatch
from pathlib import Path
from typing import Any

import numpy as np

from ...planner.errors import UnknownName
from ..console import check_writable, console, labeled, writing
from .learning import LEARNING_LINES
from .like_for_like import LIKE_LINES
from .measuring import Row, row, seconds_per_call
from .near_contact import NEAR_LINES
from .peers import READY, dq_robotics_tick, panda_urdf, pinocchio_kinematics
from .planner import LINES
from .report import REPORT_LINES
from .runs import RUN_LINES
from .tasks import TASK_LINES, started
from .thinking import LONG_LINES, THINKING_LINES

TICK = "controller tick from Python / DQ_Robotics"
KINEMATICS = "FK + Jacobian call / Pinocchio"
PEER_STEP = "Stack step / robosuite's own step"
MEMORY = "second environment in a process"
IMPORT = "import onedemo.envs"
START = "warm start to the first moving step"
HELP = "onedemo --help"


def _panda() -> tuple[Any, np.ndarray, np.ndarray]:
    """Return the arrays of the Panda's controller, joints (7,) [rad], and a reachable target (8,)."""
    from ...planner import Arm, ControllerSettings
    from ...planner.control.arm_arrays import arm_arrays

    arm = Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8")
    return arm_arrays(arm, ControllerSettings(law="paper").packed()), READY, np.array(arm.fk(READY + 0.1).dq)


def _kinematics() -> Row:
    from ...planner.control.arm_arrays import refresh

    work, q, _ = _panda()
    ours, theirs = seconds_per_call(lambda: refresh(work, q), pinocchio_kinematics(q))
    note = f"{ours * 1e6:.2f} us against {theirs * 1e6:.2f} us (computeFrameJacobian, updateFramePlacement)"
    return row(KINEMATICS, ours / theirs, "ratio", 0.7, note)


def _tick() -> Row:
    from ...planner.control.controller import tick

    (work, q, target), qdot = _panda(), np.empty(7)
    peer = dq_robotics_tick(q, target)
    if peer is None:
        return Row(TICK, None, "ratio", 1 / 12, None, "needs: pip install 'onedemo[peers]'")
    mine, theirs = seconds_per_call(lambda: tick(work, q, target, 1.0, qdot), peer)
    note = f"{mine * 1e6:.2f} us against {theirs * 1e6:.1f} us, the corrected paper law with null space"
    return row(TICK, mine / theirs, "ratio", 1 / 12, note)


def _peer_step() -> Row:
    two, peer = started("stack", n_blocks=2), _robosuite_stack()
    peer.reset()
    action, idle = np.zeros(two.action_space.shape), np.zeros(peer.action_dim)
    ours, theirs = seconds_per_call(lambda: two.step(action), lambda: peer.step(idle))
    ours, theirs = ours / two.control_dt, theirs * peer.control_freq
    note = f"per simulated second {ours * 1e3:.1f} ms against {theirs * 1e3:.0f} ms, two blocks each"
    return row(PEER_STEP, ours / theirs, "ratio", 1 / 8, note)


def _robosuite_stack() -> Any:
    import robosuite

    return robosuite.make(
        "Stack", robots="Panda", has_renderer=False, has_offscreen_renderer=False, use_camera_obs=False,
        ignore_done=True,
    )  # fmt: skip


_MEMORY = """
import gymnasium, resource, onedemo.envs
def resident():
    with open("/proc/self/statm") as file:
        return int(file.read().split()[1]) * resource.getpagesize() / 2**20
first = gymnasium.make("onedemo/Stack-v0"); first.reset(seed=0)
before = resident()
second = gymnasium.make("onedemo/Stack-v0"); second.reset(seed=0)
print(resident() - before)
"""
_IMPORT = """
import sys, time
start = time.perf_counter()
import onedemo.envs
print(time.perf_counter() - start if "robosuite" not in sys.modules else float("nan"))
"""
_START = """
import time
start = time.perf_counter()
import gymnasium, onedemo, onedemo.envs
env = gymnasium.make("onedemo/Stack-v0")
policy = onedemo.make_policy("screw", env.unwrapped.task, onedemo.load_demonstration("stack"))
observation, _ = env.reset(seed=0)
action, _ = policy.predict(observation)
assert abs(action[:-1]).max() > 0
env.step(action)
print(time.perf_counter() - start)
"""


def _memory() -> Row:
    return row(MEMORY, _measured(_MEMORY), "MB", 120.0, "growth of the resident memory")


def _import() -> Row:
    return row(IMPORT, _measured(_IMPORT), "s", 2.0, "without importing robosuite")


def _start() -> Row:
    _measured(_START)
    return row(START, _measured(_START), "s", 10.0, "a new process, compiled kernels cached")


def _help() -> Row:
    run = [sys.executable, "-c", "from onedemo.bench.cli import main; main()", "--help"]
    seconds = []
    for _ in range(7):
        begun = time.perf_counter()
        subprocess.run(run, capture_output=True, check=True)
        seconds.append(time.perf_counter() - begun)
    return row(HELP, statistics.median(seconds), "s", 0.5, "a new process")


def _measured(code: str) -> float:
    """Return the number that a Python program prints last."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])


Lines = dict[str, Callable[[], Row]]
LONG = "ticks"
"""Group that is measured only where it is asked for: 180 episodes, some twenty minutes."""
GROUPS: dict[str, Lines] = {
    "controller": {TICK: _tick, KINEMATICS: _kinematics},
    "planner": {**LINES, **NEAR_LINES, **LIKE_LINES},
    "step": {**TASK_LINES, PEER_STEP: _peer_step},
    "run": RUN_LINES,
    "process": {MEMORY: _memory, IMPORT: _import, START: _start, HELP: _help},
    "report": REPORT_LINES,
    "learning": LEARNING_LINES,
    "thinking": THINKING_LINES,
    LONG: LONG_LINES,
}
"""Measurements by group and name."""


def matching(pattern: str, *, long: bool = False) -> Lines:
    """Return the measurements whose group or name matches a shell pattern, or whose name contains it; measure nothing.

    Args:
        pattern: shell pattern, or part of a name.
        long: whether those of the long group are among them, too.

    Raises:
        UnknownName: no measurement matches; the message lists groups and names.
    """
    found = {
        name: measure
        for group, lines in GROUPS.items()
        if long or group != LONG
        for name, measure in lines.items()
        if fnmatch(group, pattern) or fnmatch(name.lower(), f"*{pattern.lower()}*")
    }
    if not found:
        names = [name for lines in GROUPS.values() for name in lines]
        raise UnknownName("group or line of perf", pattern, [*GROUPS, *names])
    return found


def write_json(rows: list[Row], path: Path) -> None:
    """Write the rows as `{"rows": [...]}`.

    Args:
        rows: measured rows.
        path: the file.
    """
    path.write_text(json.dumps({"rows": [asdict(line) for line in rows]}, indent=2) + "\n", encoding="utf-8")


def run_perf(pattern: str, json_file: Path | None, *, long: bool = False) -> int:
    """Measure and print a table.

    Args:
        pattern: shell pattern of groups or names; see `matching`.
        json_file: file for the rows, or None.
        long: also measure whole episodes, which takes long.

    Returns:
        The exit code: 1 if a row misses its limit.

    Raises:
        UnknownName: no measurement matches the pattern.
        BadConfig: the file cannot be written, which is checked before anything is measured.
    """
    wanted = matching(pattern, long=long)
    if json_file:
        check_writable("--json", json_file)
    out, rows = console(), []
    out.print("a row passes if its value does not exceed its limit")
    for name, measure in wanted.items():
        with console(stderr=True).status(f"measuring: {name}"):
            rows.append(measure())
        _print(out, rows[-1])
    if json_file:
        with writing("--json", json_file):
            write_json(rows, json_file)
    return 1 if any(line.ok is False for line in rows) else 0


def _print(out: Any, line: Row) -> None:
    value = "-" if line.value is None else f"{line.value:.3g} {line.unit}"
    goal = "" if line.goal is None else f"(goal {line.goal:.3g})"
    word, style = {True: ("ok    ", "green"), False: ("missed", "red"), None: ("-     ", "")}[line.ok]
    out.print(labeled(word, style, f"{line.name}: {value} {goal}"))
    if line.note:
        out.print(f"        {line.note}", style="dim")
