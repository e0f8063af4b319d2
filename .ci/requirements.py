"""Print what pyproject.toml asks for at one end of the allowed versions, for pip: `requirements.py newest|oldest`.

newest: the dependencies without bounds, and without the simulator's, which hold others back; with the tools of the
tests. oldest: every dependency at its lower bound, with the newest tools.
"""

import re
import sys
from pathlib import Path

try:
    import tomllib
except ImportError:  # Python 3.10
    from pip._vendor import tomli as tomllib

SIMULATORS = {"robosuite"}
TOOLS = {"pytest", "pytest-xdist", "hypothesis", "pytransform3d", "movement_primitives"}
NEED = re.compile(r"([A-Za-z0-9_.-]+)(?:>=([\d.]+))?")

project = tomllib.loads((Path(__file__).parent.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]
needs = [NEED.match(need).groups() for need in project["dependencies"]]
tools = [name for name, _ in (NEED.match(need).groups() for need in project["optional-dependencies"]["dev"])]
if sys.argv[1:] == ["newest"]:
    names = [name for name, _ in needs if name not in SIMULATORS] + [name for name in tools if name in TOOLS]
elif sys.argv[1:] == ["oldest"]:
    names = [f"{name}=={lowest}" for name, lowest in needs] + [name for name in tools if name in TOOLS]
else:
    sys.exit(__doc__)
sys.stdout.write("\n".join(names) + "\n")
