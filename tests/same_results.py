"""Whether a change of the code has changed any result by a bit.

Record before and after, then compare; only the command and its files are used, so that any layout of the code will do:

    python tests/same_results.py record before.json
    python tests/same_results.py record after.json
    python tests/same_results.py compare before.json after.json

It plays every task at each level, every method, every robot and every condition of a cell, makes the plans of the
shipped scenes, and takes down the digest of every episode's record and of what was measured at each of its ticks.
"""

from __future__ import annotations

import argparse
import hashlib
import json
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).parent.parent
ONEDEMO = Path(sys.executable).parent / "onedemo"
TIMINGS = ("wall_seconds", "tick_us", "seconds", "cpu_seconds", "time_us", "scenario_us")
JOINTS = {"control_mode": "joint_velocity", "reward": "sparse"}
BIG, SMALL = ("stack", "pour", "shelve"), ("reach", "place_one", "tilt_pour", "insert_one")
SHOWN = {"pour": "pour", "bimanual_pour": "pour", "tilt_pour": "pour", "shelve": "shelve", "insert_one": "shelve"}
METHODS = ("tsia", "decoupled", "replay", "dmp-goal", "dmp-world", "potential", "rrt")
ABLATIONS = ("screw-trees-only", "screw-search-only", "screw-guard-only", "screw-no-guard", "screw-ee-only")
LEARNED = ("bc", "sac", "sac-demo")
SCENES = ("free", "sphere", "shelf", "clutter", "wall_gap", "cage")


def grid(name: str, task: str, sweep: dict[str, list[Any]], **more: Any) -> dict[str, Any]:
    """A config of a comparison."""
    base = {"name": name, "task": task, "demonstration": SHOWN.get(task, "stack"), "episodes": 1, "video": False}
    return {**base, "trajectories": True, "sweep": sweep, **more}


def grids() -> list[dict[str, Any]]:
    """All that is played."""
    levels = {"level": ["L1", "L2", "L3", "L4", "F"]}
    short = {"level": ["L1", "L2", "R"]}
    """Of the tasks whose motion is too short for obstacles."""
    made = [grid(f"level-{task}", task, levels, episodes=2) for task in BIG]
    made += [
        grid(f"level-{task}", task, levels if task in SMALL[:2] else short, episodes=2, env=JOINTS) for task in SMALL
    ]
    made += [grid("level-bimanual_pour", "bimanual_pour", levels, episodes=2, robot="Baxter")]
    made += [grid("methods", "stack", {"method": [*METHODS, *ABLATIONS]}, level="L4")]
    made += [grid("methods-pour", "pour", {"method": [*METHODS]}, level="L3", seed=3)]
    made += [grid("methods-shelve", "shelve", {"method": [*METHODS]}, level="L3", seed=5)]
    made += [grid("learned", "place_one", {"method": [*LEARNED]}, env={"reward": "sparse"})]
    made += [grid("residual", "place_one", {"method": ["residual"]}, env=JOINTS)]
    made += [grid("learned-reach", "reach", {"method": ["sac", "ppo"]}, env={"reward": "dense"})]
    robots = {"robot": ["Baxter", "Sawyer", "IIWA", "UR5e", "Kinova3"]}
    made += [grid("robots", "stack", robots, level="L3"), grid("robots-pour", "pour", robots, level="L2")]
    made += [grid("robots-shelve", "shelve", {"robot": robots["robot"][:3]}, level="L2")]
    made += [grid("shown", "stack", {"level": ["S", "T", "R"], "method": ["screw", "dmp-goal"]})]
    made += [grid("paper", task, {"obstacles": ["paper"]}, level="L2") for task in ("stack", "shelve")]
    return made


def plain(value: Any) -> Any:
    """The value without what differs from run to run."""
    if isinstance(value, dict):
        return {key: plain(each) for key, each in value.items() if key not in TIMINGS}
    return [plain(each) for each in value] if isinstance(value, list) else value


def digest(value: Any) -> str:
    """Twelve hexadecimal digits of anything that JSON can hold."""
    return hashlib.sha256(json.dumps(value, sort_keys=True).encode()).hexdigest()[:12]


def arrays_digest(path: Path) -> str:
    """The same of all arrays of a file."""
    total = hashlib.sha256()
    with np.load(path, allow_pickle=False) as file:
        for key in sorted(file.files):
            total.update(f"{key} {file[key].dtype} {file[key].shape}".encode() + file[key].tobytes())
    return total.hexdigest()[:12]


def played(config: dict[str, Any], place: Path) -> dict[str, str]:
    """The digest of each episode of a config, and of what its cells are called by."""
    path = place / f"{config['name']}-{config['task']}.yaml"
    path.write_text(json.dumps(config), encoding="utf-8")
    output = place / f"runs-{path.stem}"
    done = subprocess.run([ONEDEMO, "run", path, "--output", output, "--quiet"], capture_output=True, text=True)
    folders = list(output.glob("*")) if output.exists() else []
    if done.returncode or len(folders) != 1:
        return {f"{path.stem}: failed": (done.stdout + done.stderr)[-400:]}
    found = {f"{path.stem} folder": folders[0].name}
    for line in (folders[0] / "episodes.jsonl").read_text(encoding="utf-8").splitlines():
        record = json.loads(line)["record"]
        facts = {key: value for key, value in record.items() if key not in ("wall_seconds", "tick_us")}
        key = " ".join(str(record[each]) for each in ("task", "robot", "level", "method", "seed"))
        found[f"{path.stem}: {key} {record['cell']}"] = digest(facts)
    for path in sorted(folders[0].glob("**/*.npz")):
        found[f"{config['name']}-{config['task']}/{path.relative_to(folders[0])}"] = arrays_digest(path)
    return found


def planned(scene: str, place: Path) -> dict[str, str]:
    """The digest of a shipped scene's plan."""
    path = place / f"{scene}.json"
    subprocess.run([ONEDEMO, "plan", scene, "--output", path], capture_output=True, text=True)
    if not path.exists():
        return {f"plan {scene}": "no file"}
    return {f"plan {scene}": digest(plain(json.loads(path.read_text(encoding="utf-8"))))}


def record(path: Path) -> None:
    """Play and plan everything; what is written already is kept, so that an interrupted recording goes on."""
    found = json.loads(path.read_text(encoding="utf-8")) if path.exists() else {}
    with tempfile.TemporaryDirectory() as folder:
        place = Path(folder)
        work = [(f"{each['name']}-{each['task']}", played, each) for each in grids()]
        work += [(f"plan {scene}", planned, scene) for scene in SCENES]
        for name, make, what in work:
            if name not in found:
                found[name] = make(what, place)
                print(f"{name}: {len(found[name])}", flush=True)
                path.write_text(json.dumps(found, indent=1, sort_keys=True), encoding="utf-8")
    golden = ROOT / "tests" / "bench" / "golden_report.md"
    found["golden report"] = {"golden report": hashlib.sha256(golden.read_bytes()).hexdigest()[:12]}
    path.write_text(json.dumps(found, indent=1, sort_keys=True), encoding="utf-8")


def compare(before: Path, after: Path) -> int:
    """Print what differs; 1 if anything does."""
    one, two = (json.loads(path.read_text(encoding="utf-8")) for path in (before, after))
    flat = [{key: value for part in each.values() for key, value in part.items()} for each in (one, two)]
    different = [key for key in sorted({*flat[0], *flat[1]}) if flat[0].get(key) != flat[1].get(key)]
    for key in different:
        print(f"{key}: {flat[0].get(key)} before, {flat[1].get(key)} after")
    print(f"{len(flat[0])} digests before, {len(flat[1])} after, {len(different)} different")
    return int(bool(different))


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("record", "compare"))
    parser.add_argument("files", nargs="+", type=Path)
    given = parser.parse_args()
    if given.what == "compare":
        raise SystemExit(compare(*given.files))
    record(given.files[0])
