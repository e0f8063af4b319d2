"""docs/your_task.md: its blocks and commands run as they stand, in order, in an empty folder, down to a report."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys

import pytest
from helpers.import_graph import ROOT

PAGE = (ROOT / "docs" / "your_task.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
RUN, COMPARISON = "onedemo run my_tasks:CUBE_IN_TRAY level=L2 episodes=3", "onedemo run mine.yaml"


def ran(folder, *arguments: str) -> str:
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("runs", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_page_goes_from_nothing_to_a_report(runs, tmp_path):
    said = {}
    for kind, block in BLOCKS:
        if kind == "python" and "CUBE_IN_TRAY = Task(" in block:
            (tmp_path / "my_tasks.py").write_text(block, encoding="utf-8")
        elif kind == "python":
            said["python"] = ran(tmp_path, "-c", block)
        elif kind == "yaml":
            (tmp_path / "mine.yaml").write_text(block, encoding="utf-8")
        else:
            for command in block.splitlines():
                if runs or not command.startswith("onedemo run"):
                    words = ["-c", "from onedemo.bench.cli import main; main()", *shlex.split(command)[1:]]
                    said[command] = ran(tmp_path, *words)
    assert "| tray | fixture | 5 | 120 x 120 x 30 |" in said["onedemo tasks my_tasks:CUBE_IN_TRAY"]
    checked = said["onedemo demo check cube_in_tray.npz --task my_tasks:CUBE_IN_TRAY"]
    assert "carry cube: ends relative to tray" in checked
    assert "start" in said["python"]
    if runs:
        assert "3 of 3 succeeded" in said[RUN]
        assert (tmp_path / said[RUN].splitlines()[-1] / "report.html").is_file()
        report = tmp_path / said[COMPARISON].splitlines()[-1] / "report.md"
        assert "CUBE\\_IN\\_TRAY" in report.read_text(encoding="utf-8")
