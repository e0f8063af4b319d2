"""A kernel's cache notices a change of whatever the kernel may call, and lies where files can be written."""

from __future__ import annotations

import errno
import os
import stat
import subprocess
import sys
import tempfile
import warnings
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path

import pytest
from numba.core import caching

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
    known = (jit.content_digest, jit._imported, jit.cache_folder)
    for each in known:
        each.cache_clear()
    yield
    for each in known:
        each.cache_clear()


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


# Where the cache lies


@pytest.fixture
def machine(tmp_path, monkeypatch):
    """A machine with a home, a temporary folder and a source file of its own."""
    for name in ("home", "temporary"):
        (tmp_path / name).mkdir()
    source = tmp_path / "source.py"
    source.write_text("# nothing\n")
    monkeypatch.setattr(jit.config, "CACHE_DIR", "")
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.setenv("HOME", str(tmp_path / "home"))
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path / "temporary"))
    return tmp_path


def folder_of(machine: Path) -> Path | None:
    jit.cache_folder.cache_clear()
    return jit.cache_folder(machine / "source.py")


def kernels_of(machine: Path) -> Path:
    return machine / "home" / ".cache" / "onedemo" / "kernels"


def temporary_of(machine: Path) -> Path:
    return machine / "temporary" / f"onedemo-kernels-{os.getuid()}"


@pytest.mark.parametrize("place", ["", "NUMBA_CACHE_DIR", "XDG_CACHE_HOME"])
def test_the_digest_stands_below_every_cache_folder(place, machine, monkeypatch):
    root = kernels_of(machine)
    if place == "NUMBA_CACHE_DIR":
        root = machine / "chosen"
        monkeypatch.setattr(jit.config, "CACHE_DIR", str(root))
    elif place:
        root = machine / "xdg" / "onedemo" / "kernels"
        monkeypatch.setenv(place, str(machine / "xdg"))
    before = folder_of(machine)
    assert before == root / jit.content_digest(machine / "source.py") and before.is_dir()
    (machine / "source.py").write_text("# something\n")
    jit.content_digest.cache_clear()
    assert folder_of(machine) != before


def block_home(machine, monkeypatch):
    (machine / "home" / ".cache").write_text("a file is in the way")


def no_home(machine, monkeypatch):
    def none() -> Path:
        raise RuntimeError("could not determine home directory")

    monkeypatch.setattr(Path, "home", none)


def read_only_home(machine, monkeypatch):
    """As it is without root's rights: the folder is there, and takes no file."""
    kernels_of(machine).mkdir(parents=True)
    refuse_files(machine / "home", errno.EROFS, monkeypatch)


def full_home(machine, monkeypatch):
    class Full:
        def __enter__(self):
            return self

        def __exit__(self, *_):
            return None

        def write(self, content):
            raise OSError(errno.ENOSPC, "No space left on device")

    real = tempfile.TemporaryFile
    at_home = str(machine / "home")
    monkeypatch.setattr(
        tempfile, "TemporaryFile", lambda dir: Full() if str(dir).startswith(at_home) else real(dir=dir)
    )


def foreign_home(machine, monkeypatch):
    kernels_of(machine).mkdir(parents=True)
    monkeypatch.setattr(jit, "_is_foreign", lambda folder: folder == kernels_of(machine))


def unwritable_choice(machine, monkeypatch):
    monkeypatch.setattr(jit.config, "CACHE_DIR", "/proc/self")


def refuse_files(below: Path, reason: int, monkeypatch) -> None:
    real = tempfile.TemporaryFile

    def refusing(dir):
        if str(dir).startswith(str(below)):
            raise OSError(reason, os.strerror(reason))
        return real(dir=dir)

    monkeypatch.setattr(tempfile, "TemporaryFile", refusing)


UNFIT = (block_home, no_home, read_only_home, full_home, foreign_home, unwritable_choice)


@pytest.mark.parametrize("spoil", UNFIT, ids=lambda spoil: spoil.__name__)
def test_what_cannot_be_written_gives_way_to_a_private_temporary_folder(spoil, machine, monkeypatch):
    spoil(machine, monkeypatch)
    assert folder_of(machine) == temporary_of(machine) / jit.content_digest(machine / "source.py")
    assert stat.S_IMODE(temporary_of(machine).stat().st_mode) == 0o700


def test_a_folder_of_another_user_is_foreign_and_one_of_root_is_not(machine, monkeypatch):
    uid = machine.stat().st_uid
    monkeypatch.setattr(jit.os, "getuid", lambda: uid + 1)
    assert jit._is_foreign(machine) == (uid != 0)
    monkeypatch.setattr(jit.os, "getuid", lambda: uid)
    assert not jit._is_foreign(machine) and not jit._is_foreign(machine / "not there yet")


def planted(folder: Path) -> None:
    folder.mkdir()
    folder.chmod(0o777)


def linked(folder: Path) -> None:
    (folder.parent / "elsewhere").mkdir()
    folder.symlink_to(folder.parent / "elsewhere")


def in_the_way(folder: Path) -> None:
    folder.write_text("a file")


@pytest.mark.parametrize("spoil", [planted, linked, in_the_way], ids=lambda spoil: spoil.__name__)
def test_a_temporary_folder_that_is_not_this_users_alone_is_refused(spoil, machine, monkeypatch):
    block_home(machine, monkeypatch)
    spoil(temporary_of(machine))
    with pytest.warns(UserWarning, match="compiled anew in every process"):
        assert folder_of(machine) is None


def test_a_temporary_folder_that_somebody_else_made_is_refused(machine, monkeypatch):
    block_home(machine, monkeypatch)
    mine = os.getuid()
    monkeypatch.setattr(jit.os, "getuid", lambda: mine + 1)
    temporary_of(machine).mkdir()
    with pytest.warns(UserWarning, match="no folder"):
        assert folder_of(machine) is None


def test_a_source_in_an_archive_has_no_cache(machine):
    assert jit.cache_folder(machine / "source.py" / "inside.py") is None


# Compiled


KERNEL = "from onedemo.planner.jit import kernel\n\n\n@kernel\ndef twice(x):\n    return 2.0 * x\n"


def twice_from(machine: Path):
    """The kernel of a file, as a new process would load it."""
    jit.cache_folder.cache_clear()
    spec = spec_from_file_location("kernels", machine / "kernels.py")
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.twice


def cached_files(folder: Path) -> list[Path]:
    return sorted(path for path in folder.rglob("*") if path.suffix in (".nbi", ".nbc"))


def test_kernels_are_compiled_without_a_cache_where_nothing_can_be_written(machine, monkeypatch):
    (machine / "kernels.py").write_text(KERNEL)
    block_home(machine, monkeypatch)
    in_the_way(temporary_of(machine))
    with pytest.warns(UserWarning, match="compiled anew"):
        twice = twice_from(machine)
    assert twice(3.0) == 6.0 and cached_files(machine) == []


def test_numba_caches_nowhere_else(machine, monkeypatch):
    """Its own second choice, beside the source, is named after no content."""
    (machine / "kernels.py").write_text(KERNEL)
    monkeypatch.setattr(caching.CacheImpl, "_locator_classes", caching.CacheImpl._locator_classes[1:])
    twice = twice_from(machine)
    assert twice(3.0) == 6.0 and cached_files(machine) == []


def test_a_cache_that_is_full_or_damaged_costs_time_and_no_result(machine, monkeypatch):
    (machine / "kernels.py").write_text(KERNEL)
    twice = twice_from(machine)

    def full(*_):
        raise OSError(errno.ENOSPC, "No space left on device")

    with monkeypatch.context() as patched:
        patched.setattr(twice._cache._cache_file, "save", full)
        with pytest.warns(UserWarning, match="No space left"):
            assert twice(3.0) == 6.0
    assert twice_from(machine)(3.0) == 6.0
    files = cached_files(kernels_of(machine))
    assert {path.suffix for path in files} == {".nbi", ".nbc"}
    for damaged in files:
        damaged.write_bytes(damaged.read_bytes()[:20])
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            assert twice_from(machine)(3.0) == 6.0
        assert all(len(path.read_bytes()) > 20 for path in cached_files(kernels_of(machine)))


def test_an_edit_two_files_away_is_seen_below_a_chosen_cache_folder(tmp_path):
    """As in containers and on clusters, which set it."""
    lowest = KERNEL.replace("kernel", "inner")
    top = (
        "from onedemo.planner.jit import kernel\nfrom .low import twice\n\n\n@kernel\ndef f(x):\n    return twice(x)\n"
    )
    written(tmp_path, {"pack/__init__.py": "", "pack/low.py": lowest, "pack/top.py": top})

    def answer() -> str:
        environment = {**os.environ, "NUMBA_CACHE_DIR": str(tmp_path / "cache"), "PYTHONPATH": str(tmp_path)}
        code = "from pack.top import f; print(f(1.0))"
        return subprocess.run(
            [sys.executable, "-c", code], env=environment, check=True, capture_output=True, text=True
        ).stdout

    assert answer() == "2.0\n"
    (tmp_path / "pack/low.py").write_text(lowest.replace("2.0", "3.0"))
    assert answer() == "3.0\n"
    assert len(cached_files(tmp_path / "cache")) == 2 * 4
