"""The pages of the tasks are what their docstrings say."""

from __future__ import annotations

from pathlib import Path

import pytest

from onedemo.bench.task_pages import page_text
from onedemo.envs import IDS, TASKS

PAGES = Path(__file__).parents[2] / "docs" / "tasks"
SECTIONS = ("Description", "Action Space", "Observation Space", "Rewards", "Starting State", "Episode End", "Info",
            "Arguments", "Version History")  # fmt: skip


@pytest.mark.parametrize("task", sorted(TASKS))
def test_a_page_is_its_docstring_and_has_all_sections_and_a_clip(task):
    page = (PAGES / f"{task}.md").read_text(encoding="utf-8")
    assert page == page_text(task), "run: make docs"
    for section in SECTIONS:
        assert f"\n## {section}\n" in page, section
    assert (PAGES / f"{task}.webp").stat().st_size > 10_000
    assert TASKS[task].page.summary in page


def test_every_environment_has_a_page():
    assert {facts.id for facts in TASKS.values()} == set(IDS)
