"""Bugs to plant in a copy of the planner, and whether the tests notice.

    python tests/planted.py [name ...]

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

from helpers.planner.planted_bugs import BUGS, Bug

ROOT = Path(__file__).parents[1]


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
            (file,) = (ROOT / "tests" / "planner").glob(f"**/test_{stem}.py")
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
