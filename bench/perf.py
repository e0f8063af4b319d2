"""`onedemo perf`: speeds as ratios within one run, since machines differ and are shared."""

from __future__ import annotations

import json
import statistics
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from dataclasses import asdict, dataclass
from fnmatch import fnmatch
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from .console import console, labeled

BATCHES = 15
BATCH_SECONDS = 0.02


@dataclass(frozen=True, slots=True)
class Row:
    """One measured line.

    Attributes:
        name: what is measured.
        value: the figure; None where it could not be measured.
        unit: of the figure ("ratio", "us", "ms", "MB", "s").
        goal: largest value that is well; None where there is no bar.
        ok: the bar is met; None where there is none or nothing was measured.
        note: what it was measured against, or why it was not.
    """

    name: str
    value: float | None
    unit: str
    goal: float | None
    ok: bool | None
    note: str


def row(name: str, value: float, unit: str, goal: float | None, note: str = "") -> Row:
    """A measured line with its verdict."""
    return Row(name, value, unit, goal, None if goal is None else value <= goal, note)


def seconds_per_call(*functions: Callable[[], object]) -> list[float]:
    """Median seconds per call of each function, their batches interleaved so that noise hits all alike."""
    counts = []
    for function in functions:
        function()
        start = time.perf_counter()
        function()
        counts.append(max(1, round(BATCH_SECONDS / max(time.perf_counter() - start, 1e-9))))
    samples: list[list[float]] = [[] for _ in functions]
    for _ in range(BATCHES):
        for function, count, sample in zip(functions, counts, samples, strict=True):
            start = time.perf_counter()
            for _ in range(count):
                function()
            sample.append((time.perf_counter() - start) / count)
    return [statistics.median(sample) for sample in samples]


def _controller_rows() -> Iterator[Row]:
    from ..planner.arm import Arm
    from ..planner.controller import ControllerSettings, tick
    from ..planner.workspace import bound, refresh

    urdf = _panda_urdf()
    arm = Arm.from_urdf(urdf, tcp_frame="panda_link8")
    q = np.array([0.0, 0.2, 0.0, -2.6, 0.0, 2.9, 0.78])
    target, qdot = np.array(arm.fk(q + 0.1).dq), np.empty(7)
    work = bound(arm, ControllerSettings(law="paper").packed())
    yield from _peer_tick_row(lambda: tick(work, q, target, 1.0, qdot), q, target)

    import pinocchio as pin

    model = pin.buildModelFromUrdf(str(urdf))
    data, frame = model.createData(), model.getFrameId("panda_link8")

    def pinocchio() -> np.ndarray:
        """The same two results: the Jacobian in the frame's own axes, and the frame's pose."""
        jacobian = pin.computeFrameJacobian(model, data, q, frame, pin.ReferenceFrame.LOCAL)
        pin.updateFramePlacement(model, data, frame)
        return jacobian

    ours, theirs = seconds_per_call(lambda: refresh(work, q), pinocchio)
    note = f"{ours * 1e6:.2f} us against {theirs * 1e6:.2f} us (computeFrameJacobian, updateFramePlacement)"
    yield row("FK + Jacobian call / Pinocchio", ours / theirs, "ratio", 0.7, note)


def _peer_tick_row(ours: Callable[[], object], q: np.ndarray, target: np.ndarray) -> Iterator[Row]:
    name, goal = "controller tick from Python / DQ_Robotics", 1 / 12
    try:
        peer = import_module("dqrobotics")
        robots, algebra = import_module("dqrobotics.robots"), import_module("dqrobotics.utils.DQ_LinearAlgebra")
    except ImportError:
        yield Row(name, None, "ratio", goal, None, "needs: pip install 'onedemo[peers]'")
        return
    robot = robots.FrankaEmikaPandaRobot.kinematics()
    goal_pose, one, c8, pull = peer.DQ(target), peer.DQ([1.0]), peer.C8(), -0.1 * q

    def theirs() -> np.ndarray:
        """The same law with the peer's own algebra, pseudo-inverse and null-space projection included."""
        error = (one - peer.conj(robot.fkm(q)) * goal_pose).vec8()
        n = peer.haminus8(goal_pose) @ c8 @ robot.pose_jacobian(q)
        inverse = algebra.pinv(n)
        return inverse @ (15.0 * error) + pull - inverse @ (n @ pull)

    mine, peers = seconds_per_call(ours, theirs)
    note = f"{mine * 1e6:.2f} us against {peers * 1e6:.1f} us, the corrected paper law with null space"
    yield row(name, mine / peers, "ratio", goal, note)


def _panda_urdf() -> Path:
    """Path of the Panda description that robosuite ships, found without importing it."""
    from importlib.util import find_spec

    spec = find_spec("robosuite")
    assert spec is not None and spec.origin is not None
    folder = Path(spec.origin).parent / "models/assets/bullet_data/panda_description/urdf"
    return folder / "panda_arm.urdf"


def _step_rows() -> Iterator[Row]:
    import gymnasium as gym
    import mujoco

    from .. import envs  # noqa: F401  (registers the ids)

    env: Any = gym.make("onedemo/Stack-v0").unwrapped
    env.reset(seed=0)
    model, data = env.sim.model, env.sim.data
    action, substeps = np.zeros(env.action_space.shape), env.substeps
    env.step(action)
    ours, raw = seconds_per_call(lambda: env.step(action), lambda: mujoco.mj_step(model, data, substeps))
    note = f"{ours * 1e3:.3f} ms against {raw * 1e3:.3f} ms for {substeps} substeps"
    yield row("Stack step / raw mj_step", ours / raw, "ratio", 1.15, note)

    (reset,) = seconds_per_call(lambda: env.reset())
    yield row("Stack soft reset", reset * 1e3, "ms", 3.0)

    two: Any = gym.make("onedemo/Stack-v0", n_blocks=2).unwrapped
    peer = _robosuite_stack()
    two.reset(seed=0)
    peer.reset()
    idle = np.zeros(peer.action_dim)
    ours, theirs = seconds_per_call(lambda: two.step(action), lambda: peer.step(idle))
    ours, theirs = ours / two.control_dt, theirs * peer.control_freq
    note = f"per simulated second {ours * 1e3:.1f} ms against {theirs * 1e3:.0f} ms, two blocks each"
    yield row("Stack step / robosuite's own step", ours / theirs, "ratio", 1 / 8, note)


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
import gymnasium, onedemo.envs
from onedemo.baselines.factory import make_policy
from onedemo.configs.shipped import shipped_demonstration
from onedemo.planner.demo_io import load_demonstration
env = gymnasium.make("onedemo/Stack-v0")
policy = make_policy("screw", env.unwrapped.task, load_demonstration(shipped_demonstration("stack")), {})
observation, _ = env.reset(seed=0)
action, _ = policy.predict(observation)
assert abs(action[:-1]).max() > 0
env.step(action)
print(time.perf_counter() - start)
"""


def _process_rows() -> Iterator[Row]:
    yield row("second environment in a process", _measured(_MEMORY), "MB", 120.0, "growth of the resident memory")
    seconds = _measured(_IMPORT)
    yield row("import onedemo.envs", seconds, "s", 2.0, "without importing robosuite")
    _measured(_START)
    yield row(
        "warm start to the first moving step",
        _measured(_START),
        "s",
        10.0,
        "a new process, compiled kernels cached",
    )


def _measured(code: str) -> float:
    """The number that a Python program prints last."""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    return float(done.stdout.split()[-1])


GROUPS = {"controller": _controller_rows, "step": _step_rows, "process": _process_rows}


def measure(pattern: str = "*") -> Iterator[Row]:
    """The lines whose group (controller, step, process) or name matches a shell pattern."""
    for group, rows in GROUPS.items():
        for line in rows():
            if fnmatch(group, pattern) or fnmatch(line.name.lower(), f"*{pattern.lower()}*"):
                yield line


def write_json(rows: list[Row], path: Path) -> None:
    """The lines as `{"rows": [...]}`."""
    path.write_text(json.dumps({"rows": [asdict(line) for line in rows]}, indent=2) + "\n")


def run_perf(pattern: str, json_file: Path | None) -> int:
    """Measure and print a table; exit code 1 if a bar is missed."""
    out, rows = console(), []
    out.print("a line is well when its value is at most its goal")
    with console(stderr=True).status("measuring"):
        for line in measure(pattern):
            rows.append(line)
            value = "-" if line.value is None else f"{line.value:.3g} {line.unit}"
            goal = "" if line.goal is None else f"(goal {line.goal:.3g})"
            word, style = {True: ("ok    ", "green"), False: ("missed", "red"), None: ("-     ", "")}[line.ok]
            out.print(labeled(word, style, f"{line.name}: {value} {goal}"))
            if line.note:
                out.print(f"        {line.note}", style="dim")
    if json_file is not None:
        write_json(rows, json_file)
    return 1 if any(line.ok is False for line in rows) else 0
