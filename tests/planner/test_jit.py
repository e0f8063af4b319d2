"""A kernel's cache notices a change of whatever the kernel may call."""

from __future__ import annotations

from pathlib import Path

import pytest

from onedemo.planner import jit

LOWEST = "def twice(x):\n    return 2.0 * x\n"
FILES = {
    "pack/__init__.py": "",
    "pack/low/__init__.py": "",
    "pack/low/lowest.py": LOWEST,
    "pack/low/unused.py": "",
    "pack/high/__init__.py": "",
}
TOP = "pack/high/top.py"
FACE = "if TYPE_CHECKING:\n    from .lowest import twice\n    from .unused import other\n"


@pytest.fixture(autouse=True)
def fresh():
    jit.content_digest.cache_clear()
    jit._imported.cache_clear()
    yield
    jit.content_digest.cache_clear()
    jit._imported.cache_clear()


def written(folder: Path, files: dict[str, str]) -> None:
    for name, text in files.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_text(text)


def digests(folder: Path, changed: str, text: str) -> tuple[str, str]:
    """Of the top file before and after another one is changed."""
    before = jit.content_digest(folder / TOP)
    (folder / changed).write_text(text)
    jit.content_digest.cache_clear()
    jit._imported.cache_clear()
    return before, jit.content_digest(folder / TOP)


@pytest.mark.parametrize(
    "top, middle",
    [
        ("from .middle import thrice", "from ..low.lowest import twice"),
        ("from .middle import thrice", "from ..low import lowest"),
        ("from . import middle", "from ..low import lowest as other"),
        ("from .middle import (\n    # why\n    thrice,\n)", "from ..low import (\n    lowest,\n)"),
        ("from .middle import \\\n    thrice", "from ..low.lowest import (\n    twice as double,\n)"),
        ("def late():\n    from .middle import thrice", "if True:\n    from ..low.lowest import twice"),
    ],
)
def test_a_change_two_modules_away_is_another_digest(top, middle, tmp_path):
    written(tmp_path, {**FILES, TOP: top + "\n", "pack/high/middle.py": middle + "\n"})
    before, after = digests(tmp_path, "pack/low/lowest.py", LOWEST.replace("2.0", "3.0"))
    assert before != after


@pytest.mark.parametrize("changed, differs", [("pack/low/lowest.py", True), ("pack/low/unused.py", False)])
def test_through_a_face_only_what_is_imported_counts(changed, differs, tmp_path):
    files = {**FILES, "pack/low/__init__.py": FACE, TOP: "from ..low import twice\n"}
    written(tmp_path, files)
    before, after = digests(tmp_path, changed, "# something else\n")
    assert (before != after) == differs


def test_a_kernel_of_the_planner_notices_the_lowest_file():
    source = Path(jit.__file__).parent / "reactive" / "reactive_planner.py"
    found, todo = set(), [source]
    while todo:
        file = todo.pop()
        if file not in found:
            found.add(file)
            todo += jit._imported(file)
    assert {"screw.py", "gjk.py", "linear.py", "qp.py", "jit.py"} <= {file.name for file in found}
