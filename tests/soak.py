"""Long runs that try to break a promise; `make soak`.

    python tests/soak.py --guard 1000000 --kills 50 --seed 0 --output bench/soak.json

Of the guard in chunks that can be gone on with. Runs of episodes are killed at any moment, see `killed_runs`.

The guard: robots among obstacles, commands that want to hit them; nothing may ever come closer than it must keep,
neither at the ends of a step nor in between. Its parts are used by the test suite too.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import platform
import sys
import tempfile
import time
from functools import cache, partial
from importlib.metadata import version
from pathlib import Path
from typing import NamedTuple

import numpy as np
from helpers.arms import panda, panda_urdf, random_arm
from helpers.solids import KINDS, fcl_capsule, fcl_distance, fcl_obstacle, random_pose, random_shape

from onedemo.planner import jit
from onedemo.planner.collision.capsule_placement import place_capsules
from onedemo.planner.collision.clearance import find_near, slack_at
from onedemo.planner.collision.robot_arrays import ROW, SETTING
from onedemo.planner.escape.tangent_plane import random_number
from onedemo.planner.fitting.body_readers import body_from_urdf
from onedemo.planner.geometry.pose import Pose
from onedemo.planner.geometry.shapes import Box, Mesh, Obstacle
from onedemo.planner.robot.arm import Arm
from onedemo.planner.robot.body import BODY, Body
from onedemo.planner.robot.resting_pairs import resting_pairs
from onedemo.planner.safety import safety_layer as safety
from onedemo.planner.safety.barrier import allowed_speeds, constrain, scale_to_speeds
from onedemo.planner.safety.safety_layer import HELD, SafetyLayer, SafetySettings, safe_velocity

BANG, RANDOM, STEEPEST, TOWARDS, CORNER, ABSURD, GRAZE = range(7)
MODES = (BANG, RANDOM, CORNER, ABSURD, STEEPEST, TOWARDS, GRAZE, STEEPEST, TOWARDS, GRAZE)
# columns of a tally
STEPS, TOO_CLOSE, WORST, BEYOND, ROOMY, FALSE_STOPS, STATUS, STOPPED, AT_SURFACE = 0, 1, 2, 3, 4, 5, 6, 10, 11
TALLY = 12
PLANNER = Path(jit.__file__).parent
SLACK = 1e-9
"""Rounding [m] that is no violation."""


def command(eye, q, mode, state, keep, wanted):
    """The wanted speeds of one step into `wanted`; `keep` (n,) holds a choice that lasts."""
    n = len(q)
    for i in range(n):
        x = 2.0 * random_number(state) - 1.0
        if mode == RANDOM:
            wanted[i] = 3.0 * x * eye[ROW.speed, i]
        elif mode == BANG:
            wanted[i] = keep[i] * eye[ROW.speed, i]
        elif mode == CORNER:
            wanted[i] = 30.0 * ((eye[ROW.upper, i] if keep[i] > 0.0 else eye[ROW.lower, i]) - q[i])
        elif mode == ABSURD:
            wanted[i] = (np.nan, np.inf, -np.inf, 1e300, -1e300, 1e-300, x)[int(6.999 * random_number(state))]
    if mode in (STEEPEST, TOWARDS, GRAZE):
        here = slack_at(eye, q, 0.0, 3.0)
        for i in range(n):
            before = q[i]
            q[i] = before + 1e-6
            slope = (slack_at(eye, q, 0.0, 3.0) - here) / 1e-6
            q[i] = before
            if mode == STEEPEST:
                wanted[i] = -10.0 * eye[ROW.speed, i] * (1.0 if slope > 0.0 else -1.0)
            else:
                wanted[i] = -100.0 * slope
                if mode == GRAZE:
                    wanted[i] += 100.0 * (2.0 * random_number(state) - 1.0)


def stopped(eye, q, wanted, out, asked):
    """True if the speeds are below a hundredth of what the bounds ask for, as far as the limits allow it."""
    n, most, least = len(q), 0.0, 0.0
    for i in range(n):
        asked[i] = wanted[i] if np.isfinite(wanted[i]) else 0.0
    place_capsules(eye, q, ROW.placed)
    find_near(eye, eye[ROW.settings, SETTING.shell])
    scale_to_speeds(eye, asked)
    constrain(eye, q, asked)
    for i in range(n):
        low, high = allowed_speeds(eye, q, i)
        most = max(most, abs(min(high, max(low, asked[i]))))
        least = max(least, abs(out[i]))
    return most > 1e-4 and least < 0.01 * most


def drive(g, eye, starts, steps, dt, substeps, state, tally, log):
    """Drive a robot against its safety layer.

    Args:
        g: work array of the safety layer.
        eye: copy of it, to measure with.
        starts: (m, n) joints to start from, one after the other.
        steps: number of steps.
        dt: seconds per step.
        substeps: places looked at per step, its end among them.
        state: (1,) of the random numbers.
        tally: (TALLY,) counts, added to.
        log: (l, 2 n) rows that take joints and speeds of every so many steps.
    """
    n = starts.shape[1]
    q, p, keep, wanted, out, asked = np.empty(n), np.empty(n), np.ones(n), np.empty(n), np.empty(n), np.empty(n)
    mode, every = 0, max(1, steps // max(1, len(log)))
    for k in range(steps):
        if k % 500 == 0:
            q[:] = starts[(k // 500) % len(starts)]
        if k % 80 == 0:
            mode = MODES[int(len(MODES) * random_number(state))]
        if k % 80 == 0 or (mode == BANG and random_number(state) < 0.2):
            for i in range(n):
                keep[i] = 1.0 if random_number(state) < 0.5 else -1.0
        command(eye, q, mode, state, keep, wanted)
        room = slack_at(eye, q, 0.0, 0.05)
        status = safe_velocity(g, q, wanted, dt, out)
        worst = 1.0
        for s in range(1, substeps + 1):
            for i in range(n):
                p[i] = q[i] + s * dt * out[i] / substeps
            worst = min(worst, slack_at(eye, p, 0.0, 0.05))
        beyond = False
        for i in range(n):
            # not `>`: NaN counts
            if not (eye[ROW.lower, i] - 1e-12 <= p[i] <= eye[ROW.upper, i] + 1e-12):
                beyond = True
            if not abs(out[i]) <= eye[ROW.speed, i] * (1.0 + 1e-12):
                beyond = True
        tally[STEPS] += 1
        tally[STATUS + status] += 1
        tally[BEYOND] += 1 if beyond else 0
        tally[TOO_CLOSE] += 1 if not worst >= -SLACK else 0
        tally[WORST] = min(tally[WORST], worst)
        tally[AT_SURFACE] += 1 if room < 1e-3 else 0
        if room > eye[ROW.settings, SETTING.width]:
            tally[ROOMY] += 1
            if stopped(eye, q, wanted, out, asked):
                tally[STOPPED] += 1
                if status == HELD:
                    tally[FALSE_STOPS] += 1
        if k % every == 0 and k // every < len(log):
            log[k // every, :n] = q
            log[k // every, n:] = out
        q[:] = p


@cache
def compiled_drive():
    """Compiled afresh in every process: a cache on disk would not notice a change in the planner."""
    # the helpers are looked up as globals when `drive` is compiled
    namespace = sys.modules[__name__].__dict__
    for name in ("command", "stopped"):
        namespace[name] = jit.numba.njit(error_model="numpy")(namespace[name])
    return jit.numba.njit(error_model="numpy", nogil=True)(drive)


class Robot(NamedTuple):
    """Arms with bodies, and the pairs of capsules that may hit each other."""

    arms: list[Arm]
    bodies: list[Body]
    pairs: list[tuple[int, int]]


@cache
def panda_body() -> Body:
    return body_from_urdf(panda_urdf(), panda())


@cache
def panda_pairs() -> tuple[tuple[int, int], ...]:
    """Pairs of the Panda that are not always close: parts that are at least four joints apart."""
    frames, resting = panda_body().rows[:, BODY.frame], set(resting_pairs(panda(), panda_body()))
    some = [(i, j) for j in range(len(frames)) for i in range(j) if frames[j] - frames[i] >= 4]
    return tuple(pair for pair in some if pair not in resting)


def random_body(arm: Arm, rng: np.random.Generator) -> Body:
    """One or two capsules on most links; some are balls, some stand on the base."""
    frames = [-1, *range(arm.dof), arm.dof - 1]
    kept = [frame for frame in frames if rng.uniform() < 0.8 or frame == arm.dof - 1]
    ends = rng.uniform(-0.15, 0.15, (len(kept), 6))
    ends[:, 3:] = np.where(rng.uniform(size=(len(kept), 1)) < 0.2, ends[:, :3], ends[:, 3:])
    return Body(np.column_stack([kept, ends, rng.uniform(0.01, 0.08, len(kept))]), tuple(f"part{f}" for f in kept))


def random_robot(rng: np.random.Generator, kind: str) -> Robot:
    """A Panda, two Pandas that face each other, or a random arm with turning and sliding joints."""
    if kind == "panda":
        return Robot([panda()], [panda_body()], list(panda_pairs()))
    if kind == "two pandas":
        return facing_pandas()
    arm = random_arm(int(rng.integers(10**6)), int(rng.integers(1, 8)), 0.3)
    speed = rng.choice([1.0, 2.0, 20.0], arm.dof)
    arm = Arm(arm.name, arm.joint_names, arm.chain, arm.lower, arm.upper, speed)
    body = random_body(arm, rng)
    frames = body.rows[:, BODY.frame]
    some = [(i, j) for i in range(len(body)) for j in range(i + 1, len(body)) if abs(frames[i] - frames[j]) > 1]
    return Robot([arm], [body], [pair for pair in some if rng.uniform() < 0.5])


@cache
def facing_pandas(gap: float = 0.8) -> Robot:
    there = Pose.from_position_quaternion([gap, 0.0, 0.0], [0.0, 0.0, 0.0, 1.0])
    other = Arm.from_urdf(panda_urdf(), tcp_frame="panda_link8", world_from_base=there)
    bodies = [panda_body(), body_from_urdf(panda_urdf(), other)]
    m = len(bodies[0])
    own = [(i + k, j + k) for k in (0, m) for i, j in panda_pairs()]
    return Robot([panda(), other], bodies, own + [(i, m + j) for i in range(m) for j in range(m)])


def random_obstacles(rng: np.random.Generator) -> list[Obstacle]:
    """One to eight of all shapes; a third of the scenes has thin plates."""
    count, plates = int(rng.integers(1, 9)), rng.uniform() < 0.3
    obstacles = []
    for k in range(count):
        where = rng.normal(size=3)
        where *= rng.uniform(0.2, 0.9) / np.linalg.norm(where)
        shape = random_shape(rng, KINDS[int(rng.integers(5))], rng.choice([0.05, 0.3, 0.8]))
        if plates and k < 3:
            shape = Box((*rng.uniform(0.2, 1.0, 2), 0.002))
        obstacles.append(Obstacle(shape, random_pose(rng, where)))
    return obstacles


class Scene(NamedTuple):
    """What one chunk is about."""

    robot: Robot
    obstacles: list[Obstacle]
    layer: SafetyLayer
    starts: np.ndarray
    dt: float


def random_scene(seed: int, kind: str = "", tries: int = 300) -> Scene:
    """A scene with places to start from that are clear."""
    rng = np.random.default_rng(seed)
    while True:
        robot = random_robot(rng, kind or str(rng.choice(["panda", "random", "random"])))
        obstacles, dt = random_obstacles(rng), float(rng.choice([0.005, 0.01, 0.05]))
        layer = SafetyLayer(robot.arms, robot.bodies, obstacles, dt, settings=SETTINGS_USED, pairs=robot.pairs)
        # the distance to keep, for the tally
        layer.work[ROW.settings, SETTING.width] = SETTINGS_USED.distance
        n = layer.joints
        low, high = layer.work[ROW.lower, :n], layer.work[ROW.upper, :n]
        places = (rng.uniform(low, high) for _ in range(tries))
        starts = [q for q in places if slack_at(layer.work, q, 0.0, 1.0) > 1e-6][:20]
        if starts:
            return Scene(robot, obstacles, layer, np.array(starts), dt)


SETTINGS_USED = SafetySettings()


def run_scene(scene: Scene, seed: int, steps: int, substeps: int, logged: int) -> tuple[np.ndarray, np.ndarray]:
    """Tally (TALLY,) and log (logged, 2 n) of a chunk."""
    tally, log = np.zeros(TALLY), np.zeros((logged, 2 * scene.layer.joints))
    tally[WORST] = 1.0
    work = scene.layer.work
    state = np.array([float(seed % 2147483646 + 1)])
    compiled_drive()(work, work.copy(), scene.starts, steps, scene.dt, substeps, state, tally, log)
    return tally, log


def frames_of(arm: Arm, q: np.ndarray) -> list[np.ndarray]:
    """4 x 4 of the base and of every joint, from the chain's numbers alone."""
    frames = [np.eye(4)]
    for row, angle in zip(arm.chain[:-1], q, strict=True):
        fixed, moved = Pose.from_position_quaternion(row[4:7], row[:4]).matrix, np.eye(4)
        if row[7]:
            moved[2, 3] = angle
        else:
            c, s = np.cos(angle), np.sin(angle)
            moved[:2, :2] = [[c, -s], [s, c]]
        frames.append(frames[-1] @ fixed @ moved)
    return frames


def fcl_rooms(scene: Scene, log: np.ndarray, substeps: int) -> float:
    """Smallest room [m] in the logged steps as python-fcl sees it, with kinematics of its own.

    Where a capsule is too close, its hull is asked: what the capsule covers lies in both.
    """
    things, least, n = [fcl_obstacle(obstacle) for obstacle in scene.obstacles], np.inf, scene.layer.joints
    for row in log:
        for s in range(substeps + 1):
            q = row[:n] + s * scene.dt * row[n:] / substeps
            parts, bodies, bases, first = [], [], [], 0
            for arm, body in zip(scene.robot.arms, scene.robot.bodies, strict=True):
                frames = frames_of(arm, q[first : first + arm.dof])
                first += arm.dof
                for capsule, hull in zip(body.rows, body.hulls or [None] * len(body), strict=True):
                    frame = frames[int(capsule[0]) + 1]
                    a, b = (frame[:3, :3] @ capsule[k : k + 3] + frame[:3, 3] for k in (1, 4))
                    parts.append(fcl_capsule(a, b, capsule[7]))
                    bodies.append((hull, frame))
                    bases.append(capsule[0] < 0)
            settings, solid = scene.layer.settings, [partial(hull_solid, *place) for place in bodies]
            for c in np.flatnonzero(~np.array(bases)):
                for thing in things:
                    room = fcl_distance(parts[c], thing) - settings.distance
                    if room < 0.0 and bodies[c][0] is not None:
                        room = max(room, fcl_distance(solid[c](), thing) - bodies[c][0].rounding - settings.distance)
                    least = min(least, room)
            for i, j in scene.robot.pairs:
                room = fcl_distance(parts[i], parts[j]) - settings.self_distance
                if room < 0.0 and bodies[i][0] is not None and bodies[j][0] is not None:
                    rounding = bodies[i][0].rounding + bodies[j][0].rounding
                    room = max(room, fcl_distance(solid[i](), solid[j]()) - rounding - settings.self_distance)
                least = min(least, room)
    return float(least)


def hull_solid(hull, frame: np.ndarray):
    """A hull in fcl, without its rounding, where a frame (4, 4) puts it."""
    return fcl_obstacle(Obstacle(Mesh(hull.corners @ frame[:3, :3].T + frame[:3, 3])))


# ------------------------------------------------------------------ the long run


def sources_digest(*folders: Path) -> str:
    """sha256 of all sources in some folders."""
    digest = hashlib.sha256()
    for file in sorted(file for folder in folders for file in folder.glob("**/*.py")):
        digest.update(file.name.encode() + b"\0" + file.read_bytes())
    return digest.hexdigest()


def versions(*names: str) -> dict[str, str]:
    return {"python": platform.python_version(), **{name: version(name) for name in names}}


def fresh(seed: int) -> dict:
    return {
        "what": "guard fuzz: static scenes, adversarial commands; judged at 10 places per step, some by python-fcl",
        "planner_sha256": sources_digest(PLANNER),
        # of what the guard imports, directly or not, alone
        "guard_sha256": jit.content_digest(Path(safety.__file__)),
        "seed": seed,
        "versions": versions("numpy", "numba", "python-fcl", "pin"),
        "chunks": 0,
        "steps": 0,
        "violations": 0,
        "beyond_limits": 0,
        "worst_room_m": 1.0,
        "worst_room_by_fcl_m": 1.0,
        "steps_judged_by_fcl": 0,
        "steps_within_1_mm": 0,
        "steps_with_room": 0,
        "false_stops": 0,
        "other_stops": 0,
        "false_stop_share": 0.0,
        "status": {"free": 0, "changed": 0, "held": 0, "blocked": 0},
        "failed_seeds": [],
    }


def add_chunk(report: dict, chunk: int, steps: int) -> str:
    """Run one chunk and add it to the report; a line about it."""
    seed = report["seed"] * 1_000_003 + chunk
    scene = random_scene(seed)
    tally, log = run_scene(scene, seed, steps, 10, 10)
    room = fcl_rooms(scene, log, 4)
    # python-fcl stops early by up to 2e-5 m
    bad = tally[TOO_CLOSE] + tally[BEYOND] + (room < -2e-5)
    report["chunks"] = chunk + 1
    report["steps"] += int(tally[STEPS])
    report["violations"] += int(tally[TOO_CLOSE] + (room < -2e-5))
    report["beyond_limits"] += int(tally[BEYOND])
    report["worst_room_m"] = min(report["worst_room_m"], float(tally[WORST]))
    report["worst_room_by_fcl_m"] = min(report["worst_room_by_fcl_m"], room)
    report["steps_judged_by_fcl"] += len(log)
    report["steps_within_1_mm"] += int(tally[AT_SURFACE])
    report["steps_with_room"] += int(tally[ROOMY])
    report["false_stops"] += int(tally[FALSE_STOPS])
    report["other_stops"] += int(tally[STOPPED] - tally[FALSE_STOPS])
    report["false_stop_share"] = report["false_stops"] / max(1, report["steps_with_room"])
    for k, name in enumerate(report["status"]):
        report["status"][name] += int(tally[STATUS + k])
    if bad:
        report["failed_seeds"].append(seed)
    return (
        f"chunk {chunk:5d}  seed {seed}  {scene.robot.arms[0].name:16s} {len(scene.obstacles)} obstacles  "
        f"worst room {tally[WORST]:+.2e} m  by fcl {room:+.2e} m  bad {int(bad)}  "
        f"false stops {int(tally[FALSE_STOPS])} of {int(tally[ROOMY])}"
    )


def written(file: Path, **parts: dict) -> None:
    """Put parts into the file, the others stay."""
    values = json.loads(file.read_text(encoding="utf-8")) if file.is_file() else {}
    part = file.with_suffix(".part")
    part.write_text(json.dumps({**values, **parts}, indent=2) + "\n", encoding="utf-8")
    part.replace(file)


def soak_guard(steps: int, seed: int, chunk: int, output: Path) -> bool:
    """Go on with the steps of the guard, or begin; whether it has kept its promise."""
    report = fresh(seed)
    if output.is_file():
        before = json.loads(output.read_text(encoding="utf-8")).get("guard", {})
        if all(before.get(key) == report[key] for key in ("guard_sha256", "seed", "versions")):
            report = before
    begun = time.monotonic()
    while report["steps"] < steps:
        line = add_chunk(report, report["chunks"], min(chunk, steps - report["steps"]))
        written(output, guard=report)
        print(f"{line}  {report['steps']} steps, {time.monotonic() - begun:.0f} s", flush=True)
    print(json.dumps(report, indent=2))
    return not (report["violations"] or report["beyond_limits"])


def soak_runs(kills: int, seed: int, output: Path) -> bool:
    """Kill runs so many times; whether nothing was lost."""
    from helpers import killed_runs

    with tempfile.TemporaryDirectory() as folder:
        found = killed_runs.killed_runs(Path(folder), kills, seed)
    report = {
        "what": f"runs of {killed_runs.EPISODES} episodes without a simulator, killed at any moment and gone on with",
        "bench_sha256": sources_digest(PLANNER.parent / "bench", PLANNER.parent / "configs"),
        "seed": seed,
        "versions": versions("numpy", "pydantic"),
        **found,
    }
    written(output, kills=report)
    print(json.dumps(report, indent=2))
    return found["same_table"] and not (found["lost"] or found["twice"] or found["damaged"])


def main(arguments: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--guard", type=int, default=0, help="steps of the guard")
    parser.add_argument("--kills", type=int, default=0, help="kills of a run")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--chunk", type=int, default=5000, help="steps per scene")
    parser.add_argument("--output", type=Path, default=Path("bench/soak.json"))
    options = parser.parse_args(arguments)
    kept = True
    if options.guard:
        kept &= soak_guard(options.guard, options.seed, options.chunk, options.output)
    if options.kills:
        kept &= soak_runs(options.kills, options.seed, options.output)
    return 0 if kept else 1


if __name__ == "__main__":
    sys.exit(main())
