"""The tests notice bugs that are planted on purpose: see `planted`."""

from __future__ import annotations

import planted
import pytest


@pytest.mark.parametrize("bug", planted.BUGS, ids=lambda bug: bug.name)
def test_a_bug_is_of_one_place(bug, tmp_path):
    """It changes the source, so that it is really planted."""
    planted.copied(tmp_path, bug)
    before = (planted.ROOT / "planner" / f"{bug.file}.py").read_text(encoding="utf-8")
    assert (tmp_path / "onedemo" / "planner" / f"{bug.file}.py").read_text(encoding="utf-8") != before


@pytest.mark.slow
def test_a_copy_without_a_bug_passes():
    status, output = planted.run_tests(None, sorted({bug.tests for bug in planted.BUGS}))
    assert status == 0, output


@pytest.mark.slow
@pytest.mark.parametrize("bug", planted.BUGS, ids=lambda bug: bug.name)
def test_a_bug_is_caught(bug):
    status, output = planted.run_tests(bug, [bug.tests])
    assert status == 1, output
