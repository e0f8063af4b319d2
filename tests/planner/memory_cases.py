"""Public entries of the planner, handed arrays that are wrong in every way, or right in an unusual way.

    python tests/planner/memory_cases.py [name ...]

Every entry is tried in a child of this process: a crash ends the child, and its last line names what crashed. A line
ends in "same" (the answer for the plain array), in "refused" with the error, or in a word in capitals.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from onedemo import planner as face
from onedemo.planner import errors
from onedemo.planner.control.inverse_kinematics import inverse_kinematics, nearest_reached
from onedemo.planner.control.pursuit import Pursuit
from onedemo.planner.control.time_optimal import time_optimal
from onedemo.planner.escape.repet import clear_of, point_tool
from onedemo.planner.geometry import dualquat as dq
from onedemo.planner.geometry.smooth_path import SmoothPath, smooth
from onedemo.planner.imitation.bimanual import relative_jacobian
from onedemo.planner.imitation.tsia import screw_path
from onedemo.planner.planning.planning_scene import PlanningScene
from onedemo.planner.robot.body import Hull

HALF = np.sqrt(0.5)
TURNS = {"-": (HALF, -HALF, 0.0, 0.0), "+": (HALF, HALF, 0.0, 0.0), "0": (1.0, 0.0, 0.0, 0.0)}
OFFSETS = {
    "0": [(0, 0, 0.333), (0, 0, 0.2)], "-": [(0, 0, 0), (-0.0825, 0.384, 0)],
    "+": [(0, -0.316, 0), (0.0825, 0, 0), (0, 0, 0), (0.088, 0, 0)],
}  # fmt: skip
"""Fixed displacements of a Panda's joints and tool, by their turn about x: 0, -90 or 90 degrees."""
HOME = np.array([0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.78])
FRAMES = np.array([-1.0, 1.0, 3.0, 6.0])


def model() -> tuple[face.Arm, face.Body]:
    """A Panda of seven joints and four capsules."""
    left = {key: iter(offsets) for key, offsets in OFFSETS.items()}
    chain = np.array([[*TURNS[turn], *next(left[turn]), 0.0] for turn in "0-++-++0"])
    arm = face.Arm(
        "panda", tuple(f"joint{k}" for k in range(7)), chain, np.full(7, -2.9), np.full(7, 2.9), np.full(7, 2.0)
    )
    capsules = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.1, 0.05], (4, 1))
    return arm, face.Body(np.column_stack([FRAMES, capsules]), ("base", "upper", "fore", "hand"))


ARM, BODY = model()
START = ARM.fk(HOME)
GOAL = face.Pose.from_position_quaternion([0.0, 0.3, 0.05]) @ START
PATH = screw_path(START, GOAL, 0.02)


def ball(position: np.ndarray) -> face.Obstacle:
    return face.Obstacle(face.Sphere(0.04), face.Pose.from_position_quaternion(position), name="ball")


BALL, FAR = ball(PATH[len(PATH) // 2].position), ball(np.array([0.0, 0.0, 5.0]))
SETTINGS = face.PlanSettings(search=None)
CUBE = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)], dtype=float)
TIME = np.linspace(0.0, 1.0, len(PATH))
Q = np.linspace(HOME, HOME + 0.1, len(PATH))


class Case(NamedTuple):
    """A call with its arrays.

    Attributes:
        label: what is called.
        call: takes the arrays by name.
        arrays: good ones.
        free: of an array the axes whose length may be any.
        allowed: of an array the wrong variants that are right here, or none of this test's business.
    """

    label: str
    call: Callable[..., Any]
    arrays: Mapping[str, np.ndarray]
    free: Mapping[str, tuple[int, ...]] = {}
    allowed: Mapping[str, tuple[str, ...]] = {}


def wrong(array: np.ndarray, free: tuple[int, ...]) -> Iterator[tuple[str, Any]]:
    """Names and arrays that must be refused."""
    for axis in range(array.ndim):
        if axis not in free:
            size = array.shape[axis]
            yield f"short in {axis}", np.take(array, range(size - 1), axis)
            yield f"long in {axis}", np.take(array, [*range(size), 0], axis)
            yield f"tenfold in {axis}", np.concatenate([array] * 10, axis)
            yield f"empty in {axis}", np.take(array, [], axis)
    yield "more axes", array[None]
    yield "fewer axes", array[0]
    for name, number in (("nan", np.nan), ("inf", np.inf), ("-inf", -np.inf)):
        spoiled = array.copy()
        spoiled.flat[0] = number
        yield name, spoiled
    yield "text", array.astype(str)
    yield "complex", array + 0j
    yield "none", None
    yield "ragged", [[1.0], [1.0, 2.0]]


def right(array: np.ndarray) -> Iterator[tuple[str, Any, np.ndarray]]:
    """Names, arrays that must do, and the plain arrays whose answer they must give."""
    single = array.astype(np.float32)
    yield "float32", single, single.astype(np.float64)
    yield "big-endian", array.astype(">f8"), array
    yield "Fortran", np.asfortranarray(array), array
    spread = np.repeat(np.repeat(array, 2, -1), 2, 0) if array.ndim > 1 else np.repeat(array, 2)
    yield "strided", spread[::2, ::2] if array.ndim > 1 else spread[::2], array
    locked = array.copy()
    locked.flags.writeable = False
    yield "read-only", locked, array
    bytes_ = np.zeros(array.nbytes + 1, dtype=np.uint8)
    shifted = bytes_[1:].view(np.float64).reshape(array.shape)
    shifted[...] = array
    yield "unaligned", shifted, array
    yield "list", array.tolist(), array


def flat(value: Any) -> Any:
    """An answer as nested tuples of bytes and words, to be compared."""
    if isinstance(value, face.Plan):
        return flat((value.joints, value.path_poses, value.reason, value.how))
    if isinstance(value, face.Pose):
        return value.dq.tobytes()
    if isinstance(value, face.PosePath):
        return value.dqs.tobytes()
    if isinstance(value, np.ndarray):
        return value.shape, np.ascontiguousarray(value).tobytes()
    if isinstance(value, tuple | list):
        return tuple(flat(item) for item in value)
    if hasattr(value, "__slots__") and not isinstance(value, str | float | int):
        return tuple(flat(getattr(value, name)) for name in value.__slots__)
    return value


def arms() -> Iterator[Case]:
    names = ARM.joint_names
    parts = {"chain": ARM.chain, "lower": ARM.lower, "upper": ARM.upper, "velocity_limits": ARM.velocity_limits}
    yield Case(
        "Arm", lambda **arrays: face.Arm("arm", names, **arrays), parts, {}, {"lower": ("-inf",), "upper": ("inf",)}
    )
    for name in ("fk", "jacobian", "fk_jacobian", "margin", "checked"):
        yield Case(f"Arm.{name}", getattr(ARM, name), {"q": HOME})


def bodies() -> Iterator[Case]:
    yield Case("Body", lambda rows: face.Body(rows, BODY.names), {"rows": BODY.rows})

    def with_hull(corners: Any, pairs: Any) -> face.Body:
        """A body with a hull in every capsule; the hull's corners are used, by a query."""
        body = face.Body(BODY.rows, BODY.names, hulls=(Hull(corners),) * 4, pairs=pairs)
        face.SafetyLayer([ARM], [body], [FAR], 0.02, pairs=body.pairs or ())(HOME, np.zeros(7))
        return body

    arrays = {"corners": 0.02 * CUBE, "pairs": np.array([[0.0, 2.0], [0.0, 3.0]])}
    # no pairs: it is unknown which can hit each other
    yield Case("Body.hulls", with_hull, arrays, {"corners": (0,), "pairs": (0,)}, {"pairs": ("none",)})


def shapes() -> Iterator[Case]:
    yield Case("Box", face.Box, {"size": np.array([0.1, 0.2, 0.3])})
    yield Case("Mesh", face.Mesh, {"vertices": CUBE}, {"vertices": (0,)})
    yield Case("Mesh.hull_of", face.Mesh.hull_of, {"points": CUBE}, {"points": (0,)})
    yield Case(
        "Obstacle", lambda velocity: face.Obstacle(face.Sphere(0.1), velocity=velocity), {"velocity": np.ones(3)}
    )


def poses() -> Iterator[Case]:
    vector, quaternion = START.vector, START.quaternion
    yield Case("Pose", face.Pose, {"dq": START.dq})
    parts = {"position": vector[:3], "wxyz": quaternion}
    yield Case("Pose.from_position_quaternion", face.Pose.from_position_quaternion, parts)
    yield Case("Pose.from_vector", face.Pose.from_vector, {"vector": vector})
    yield Case("Pose.from_matrix", face.Pose.from_matrix, {"matrix": START.matrix})
    yield Case("Pose.from_yaw", lambda position: face.Pose.from_yaw(position, 0.3), {"position": vector[:3]})


def paths() -> Iterator[Case]:
    yield Case("PosePath", face.PosePath, {"dqs": PATH.dqs.copy()}, {"dqs": (0,)})
    yield Case("PosePath.from_vectors", face.PosePath.from_vectors, {"vectors": PATH.vectors}, {"vectors": (0,)})


def controllers() -> Iterator[Case]:
    yield Case("Controller", lambda q: face.Controller(ARM)(q, GOAL), {"q": HOME})
    yield Case("Pursuit.step", lambda q: Pursuit(ARM, PATH, 0.02).step(q), {"q": HOME})
    yield Case("Pursuit.roll_out", lambda q: Pursuit(ARM, PATH, 0.02).roll_out(q, 1.0), {"q": HOME})
    yield Case("inverse_kinematics", lambda seed: inverse_kinematics(ARM, GOAL, seed), {"seed": HOME})
    yield Case("nearest_reached", lambda seed: nearest_reached(ARM, GOAL, [seed]), {"seed": HOME})


def demonstrations() -> Iterator[Case]:
    def made(**arrays):
        sizes = {"cup": arrays.pop("size")}
        return face.Demonstration(
            "shown", "", "Panda", "tcp", "scripted", "MIT", path=PATH, object_sizes=sizes, **arrays
        ).time  # fmt: skip

    parts = {"time": TIME, "joint_positions": Q, "gripper": TIME, "size": np.ones(3)}
    yield Case("Demonstration", made, parts, {}, {"joint_positions": ("none",), "gripper": ("none",)})


def trees() -> Iterator[Case]:
    rows = np.zeros((3, 21))
    rows[:, :8] = PATH.dqs[:3]
    yield Case(
        "EscapeTree.from_rows", lambda rows: face.EscapeTree.from_rows(rows).poses, {"rows": rows}, {"rows": (0,)}
    )


def logs() -> Iterator[Case]:
    def made(time, joints):
        log = face.MotionLog(ARM, BODY, (FAR,), time, joints, 0.01, goal=GOAL)
        return log.time, log.joints, face.certify(log).reasons

    yield Case("MotionLog", made, {"time": TIME, "joints": Q})


def plans() -> Iterator[Case]:
    planner = face.Planner(ARM, BODY, SETTINGS)
    yield Case("Planner.plan", lambda start: planner.plan(PATH, start, GOAL, [BALL]), {"start": HOME})
    yield Case("Planner.plan to joints", lambda goal: planner.plan(PATH, HOME, goal), {"goal": HOME + 0.01})
    yield Case("Planner.answer", lambda start: planner.answer(face.PlanRequest(PATH, start, GOAL)), {"start": HOME})


def batches() -> Iterator[Case]:
    def answered(start):
        return face.plan_batch([face.PlanRequest(PATH, start, GOAL)], ARM, BODY, SETTINGS)

    yield Case("plan_batch", answered, {"start": HOME})


def settings() -> Iterator[Case]:
    yield Case("PlanSettings", lambda biases: face.PlanSettings(biases=biases), {"biases": np.eye(3)}, {"biases": (0,)})


def escapes() -> Iterator[Case]:
    parts = {"bias": np.array([0.0, 0.0, 0.5]), "workspace": np.array([[-1.0, -2.0, -3.0], [1.0, 2.0, 3.0]])}
    yield Case("RepetSettings", lambda **arrays: face.RepetSettings(**arrays).packed(), parts)


def paths_round() -> Iterator[Case]:
    tool, mask = BODY.tool(ARM), np.array([0.0])
    yield Case("escape_path", lambda tool: face.escape_path(PATH, tool, [BALL])[:3], {"tool": tool}, {"tool": (0,)})
    yield Case("clear_of", lambda tool: clear_of(START, tool, [BALL]), {"tool": point_tool(0.05)}, {"tool": (0,)})

    def masked(masks):
        return face.escape_path(PATH, tool, [BALL], masks=[int(mask) for mask in np.asarray(masks, dtype=int)])[:3]

    sizes = tuple(each for each, _ in wrong(mask, ()) if not each.startswith(("long", "tenfold")))
    yield Case("escape_path with masks", masked, {"masks": mask}, {}, {"masks": sizes})


def safety() -> Iterator[Case]:
    def filtered(q, velocity):
        return face.SafetyLayer([ARM], [BODY], [BALL], 0.02)(q, velocity)

    lenient = {"velocity": ("nan", "inf", "-inf")}
    yield Case("SafetyLayer", filtered, {"q": HOME, "velocity": np.full(7, 0.1)}, {}, lenient)

    def paired(pairs):
        return face.SafetyLayer([ARM], [BODY], [BALL], 0.02, pairs=pairs)(HOME, np.full(7, 0.1))

    nothing = {"pairs": ("none",)}
    yield Case("SafetyLayer of pairs", paired, {"pairs": np.array([[0.0, 3.0], [1.0, 3.0]])}, {"pairs": (0,)}, nothing)


def reactive() -> Iterator[Case]:
    def step(q):
        follower = face.ReactivePlanner(ARM, BODY, face.ReactiveSettings(plan=SETTINGS))
        follower.see([BALL])
        follower.go(PATH)
        return [follower.step(q)[:4] for _ in range(3)]

    yield Case("ReactivePlanner.step", step, {"q": HOME})


def refinements(refined: Callable[..., Any], **more: np.ndarray) -> Callable[[], Iterator[Case]]:
    """Cases of a refinement of a plan with other joints."""

    def cases() -> Iterator[Case]:
        plan = face.Planner(ARM, BODY, SETTINGS).plan(PATH, HOME, GOAL, [FAR])
        parts = {"joints": plan.joints[::10].copy(), **more}

        def call(joints, **arrays):
            return refined(plan._replace(joints=joints), **arrays)

        yield Case(refined.__name__, call, parts, {"joints": (0,)}, dict.fromkeys(more, ("fewer axes",)))

    return cases


LOOSE = ("nan", "inf", "-inf", "more axes")
"""Wrong variants that the algebra of dual quaternions takes: it is vectorised, and carries what is not finite on."""


def algebra() -> Iterator[Case]:
    x, y = START.dq.copy(), GOAL.dq.copy()
    yield Case("mul", dq.mul, {"a": x, "b": y}, {}, {"a": LOOSE, "b": LOOSE})
    for name in ("conj", "translation", "twist_from_dq", "normalized", "log"):
        yield Case(name, getattr(dq, name), {"x": x}, {}, {"x": LOOSE})
    curve = smooth(PATH)
    parts = {"knots": curve.knots.copy(), "dqs": curve.dqs.copy(), "twists": curve.twists.copy()}
    middle = np.array([0.5 * curve.knots[-1]])
    yield Case("SmoothPath", lambda **arrays: SmoothPath(**arrays).poses(middle), parts)
    yield Case("SmoothPath.poses", curve.poses, {"u": middle}, {"u": (0,)})


def others() -> Iterator[Case]:
    yield from algebra()
    body = ARM.jacobian(HOME)
    parts = {"x_left": START.dq.copy(), "j_left": body, "x_right": GOAL.dq.copy(), "j_right": body}
    yield Case("relative_jacobian", relative_jacobian, parts, {"j_left": (1,), "j_right": (1,)}, {"x_left": LOOSE[:3]})
    limits = {"velocity_limits": np.full(7, 2.0), "acceleration_limits": np.full(7, 5.0)}

    def timing(joints, **arrays):
        found = time_optimal(joints, arrays["velocity_limits"], arrays["acceleration_limits"], 0.02)
        return found.joints, found.velocities

    one_for_all = dict.fromkeys(limits, ("fewer axes",))
    yield Case("time_optimal", timing, {"joints": Q, **limits}, {"joints": (0,)}, one_for_all)
    scene = PlanningScene.of(ARM, BODY, [BALL], SETTINGS)
    yield Case("PlanningScene.slack", scene.slack, {"q": HOME})
    yield Case("PlanningScene.tightest", scene.tightest, {"q": HOME})


CASES: dict[str, Callable[[], Iterator[Case]]] = {
    "Arm": arms, "Body": bodies, "Box": lambda: (case for case in shapes() if case.label == "Box"),
    "Mesh": lambda: (case for case in shapes() if case.label.startswith("Mesh")),
    "Obstacle": lambda: (case for case in shapes() if case.label == "Obstacle"), "Pose": poses, "PosePath": paths,
    "Controller": controllers, "Demonstration": demonstrations, "EscapeTree": trees, "MotionLog": logs,
    "Planner": plans, "plan_batch": batches, "PlanSettings": settings, "RepetSettings": escapes,
    "escape_path": paths_round, "SafetyLayer": safety, "ReactivePlanner": reactive,
    "smoothed": refinements(face.smoothed),
    "timed": refinements(face.timed, acceleration_limits=np.full(7, 5.0)), "others": others,
}  # fmt: skip
"""The public names of the planner that take arrays, and what is public in its sub-packages."""
NO_ARRAYS = {
    *("Capsule", "Cylinder", "Sphere", "Shape"),  # numbers
    *("Certificate", "Command", "NextMotion", "Plan", "PlanRequest", "Segment"),  # records, tried where they are used
    *("ControllerSettings", "MotionSettings", "ReactiveSettings", "SafetySettings"),
    *("body_from_mujoco", "body_from_urdf", "read_demonstration", "read_log", "save_demonstration", "write_log"),
    *("certify", "final_path", "guide_index", "imitated_path"),  # logs, poses and paths, whose classes are tried
}


def tried(case: Case, name: str, changed: Any, plain: np.ndarray | None) -> str:
    """The outcome of a call with one array changed."""
    others = {key: value.copy() for key, value in case.arrays.items() if key != name}
    try:
        answer = flat(case.call(**{name: changed}, **others))
    except errors.OneDemoError as error:
        word = "refused" if plain is None else "REFUSED"
        return f"{word} {type(error).__name__}: {error}" if "\n" not in str(error) else "MANY LINES"
    except Exception as error:
        return f"UNCLEAR {type(error).__name__}: {error}"
    if plain is None:
        return "ACCEPTED"
    return "same" if answer == flat(case.call(**{name: plain}, **others)) else "DIFFERENT"


def try_all(entry: str) -> None:
    """Try an entry, a line for each outcome; what is tried stands in the line before it is."""
    for case in CASES[entry]():
        for name, array in case.arrays.items():
            allowed = case.allowed.get(name, ())
            variants = [(word, bad, None) for word, bad in wrong(array, case.free.get(name, ())) if word not in allowed]
            for word, changed, plain in [*variants, *right(array)]:
                print(f"{entry} / {case.label} / {name} / {word}: ", end="", flush=True)
                print(tried(case, name, changed, plain).replace("\n", " <newline> "), flush=True)


def main() -> None:
    for entry in sys.argv[1:] or CASES:
        child = os.fork()
        if not child:
            try_all(entry)
            print(f"{entry} ended", flush=True)
            os._exit(0)
        _, status = os.waitpid(child, 0)
        print(f"\n{entry} status {os.waitstatus_to_exitcode(status)}", flush=True)


if __name__ == "__main__":
    main()
