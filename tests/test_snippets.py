"""Snippets of the README and of the page on skills run as they stand, each alone, in an empty folder."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from helpers.import_graph import ROOT

PAGES = ("README.md", "docs/skills.md")
SNIPPETS = [
    snippet
    for page in PAGES
    for snippet in re.findall(r"```python\n(.*?)```", (ROOT / page).read_text(encoding="utf-8"), re.DOTALL)
]


def test_there_are_some():
    assert len(SNIPPETS) >= 6


@pytest.mark.parametrize("number", range(len(SNIPPETS)))
def test_a_snippet_runs_alone(number, tmp_path):
    done = subprocess.run([sys.executable, "-c", SNIPPETS[number]], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr[-2000:]
    if "certificate.ok" in SNIPPETS[number]:
        assert done.stdout.startswith("True ")
    if 'info["success"]' in SNIPPETS[number]:
        assert done.stdout.startswith("True ")
    assert not list(tmp_path.iterdir()), "a snippet leaves files behind"
