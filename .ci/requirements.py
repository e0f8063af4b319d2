"""Print for pip the versions at one end of what may be installed: `requirements.py newest|oldest`.

newest: requirements. The dependencies without bounds, but not the simulator, which holds the others back; and what the
planner's tests need besides.
oldest: constraints. Every dependency at its lower bound, all else as in constraints.txt: without these pip tries
thousands of combinations.
"""

import re
import sys
from pathlib import Path

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib

ROOT = Path(__file__).parent.parent
SIMULATOR = {"robosuite"}
TOOLS = ("pytest", "pytest-xdist", "hypothesis", "pytransform3d", "quadprog")
NAMED_EXACTLY = {"llvmlite", "pydantic-core"}
"""What numba and pydantic ask for in one version, which is another one at their lower bounds."""
NEED = re.compile(r"([A-Za-z0-9_.-]+)>=([\d.]+)")


def plain(name: str) -> str:
    """Return the name of a package as pip compares it."""
    return re.sub(r"[-_.]+", "-", name).lower()


project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
needs = dict(NEED.match(need).groups() for need in project["dependencies"])
if sys.argv[1:] == ["newest"]:
    lines = [*(name for name in needs if name not in SIMULATOR), *TOOLS]
elif sys.argv[1:] == ["oldest"]:
    tested = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    changed = {plain(name) for name in needs} | NAMED_EXACTLY
    lines = [f"{name}=={lowest}" for name, lowest in needs.items()]
    lines += [line for line in tested if "==" in line and plain(line.split("==")[0]) not in changed]
else:
    sys.exit(__doc__)
sys.stdout.write("\n".join(lines) + "\n")
