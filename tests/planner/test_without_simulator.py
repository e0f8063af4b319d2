"""The planner where no simulator is installed: every public name, a plan, and its judge."""

from __future__ import annotations

import subprocess
import sys

from helpers.arms import panda_urdf

CODE = """
import sys

class Refusing:
    def find_spec(self, name, path=None, target=None):
        if name.split(".")[0] in ("robosuite", "mujoco", "gymnasium"):
            raise ModuleNotFoundError(f"No module named {name!r}", name=name)

sys.meta_path.insert(0, Refusing())
import numpy as np
import onedemo.planner as planner

for name in planner.__all__:
    getattr(planner, name)
urdf = sys.argv[1]
arm = planner.Arm.from_urdf(urdf, tcp_frame="panda_link8")
body = planner.body_from_urdf(urdf, arm, split=1)
start = np.array([0.0, 0.2, 0.0, -2.2, 0.0, 2.4, 0.78])
goal = arm.fk(start + 0.1)
plan = planner.Planner(arm, body).plan(planner.PosePath(goal.dq[None]), start, goal)
assert plan.success, plan.why
assert planner.certify(plan.log()).ok
try:
    import mujoco
except ModuleNotFoundError:
    print("planned")
"""


def test_the_planner_needs_no_simulator():
    done = subprocess.run([sys.executable, "-c", CODE, str(panda_urdf())], capture_output=True, text=True)
    assert done.stdout == "planned\n", done.stderr
