"""docs/demonstrations.md: its snippets and commands run as they stand, in order, in an empty folder."""

from __future__ import annotations

import re
import shlex
import subprocess
import sys

import pytest
from helpers.import_graph import ROOT

PAGE = (ROOT / "docs" / "demonstrations.md").read_text(encoding="utf-8")
BLOCKS = re.findall(r"^```(\w*)\n(.*?)^```", PAGE, re.DOTALL | re.MULTILINE)
COMMANDS = [line for kind, block in BLOCKS if not kind for line in block.splitlines() if line.startswith("onedemo ")]
(SHOWN,) = [block for kind, block in BLOCKS if kind == "text"]


def ran(folder, *arguments):
    done = subprocess.run([sys.executable, *arguments], cwd=folder, capture_output=True, text=True, timeout=1200)
    assert done.returncode == 0, done.stderr[-2000:]
    return done.stdout


@pytest.mark.parametrize("runs", [False, pytest.param(True, marks=pytest.mark.slow)])
def test_the_page_goes_from_a_recording_to_a_run(runs, tmp_path):
    for kind, block in BLOCKS:
        if kind == "python":
            ran(tmp_path, "-c", block)
    said = []
    for command in COMMANDS:
        if runs or not command.startswith("onedemo run"):
            words = ["-c", "from onedemo.bench.cli import main; main()", *shlex.split(command)[1:]]
            said.append(ran(tmp_path, *words))
    assert len(COMMANDS) == 4
    assert all(line in said[1].splitlines() for line in SHOWN.splitlines())
    assert not runs or "3 of 3 succeeded" in said[2]
