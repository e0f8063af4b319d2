"""A run of two tasks that the tests of reports look at."""

from __future__ import annotations

import pytest
from helpers.example_runs import small_run

from onedemo.bench.report.report import write_report


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = small_run(tmp_path_factory.mktemp("runs") / "run", tasks=("stack", "pour"))
    write_report(folder)
    return folder
