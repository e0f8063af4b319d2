"""What is installed is what was meant."""

from __future__ import annotations

import re
import shutil
import subprocess
import sys
import zipfile
from pathlib import Path

import pytest
from helpers.import_graph import PACKAGES

if sys.version_info >= (3, 11):
    import tomllib
else:
    tomllib = pytest.importorskip("tomli")

ROOT = Path(__file__).parent.parent
PYPROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
PROJECT = PYPROJECT["project"]


def test_every_folder_of_code_is_a_listed_package():
    folders = {
        path.parent.relative_to(ROOT) for package in PACKAGES for path in (ROOT / package).glob("**/__init__.py")
    }
    names = {".".join(("onedemo", *folder.parts)) for folder in folders if folder.parts != ("face",)}
    assert set(PYPROJECT["tool"]["setuptools"]["packages"]) == {"onedemo", *names}
    mapped = {f"onedemo.{package}": package for package in PACKAGES if package != "face"}
    assert PYPROJECT["tool"]["setuptools"]["package-dir"] == {"onedemo": "face", **mapped}
    assert not (ROOT / "__init__.py").exists()
    assert not list((ROOT / "tests").glob("**/__init__.py"))


def test_every_package_says_that_it_is_typed():
    for package in PACKAGES:
        assert (ROOT / package / "py.typed").exists(), package


def test_the_wheel_holds_code_configs_demonstrations_and_licences(tmp_path):
    source = tmp_path / "source"  # a build leaves files behind that would end up in later wheels
    for item in ("pyproject.toml", "README.md", "LICENSE", *PACKAGES):
        copy = shutil.copytree if (ROOT / item).is_dir() else shutil.copy
        source.mkdir(exist_ok=True)
        copy(ROOT / item, source / item)
    build = [sys.executable, "-m", "build", "--wheel", "--no-isolation", "--outdir", str(tmp_path), str(source)]
    done = subprocess.run(build, capture_output=True, text=True)
    if "No module named build" in done.stderr:
        pytest.skip("needs the package build")
    assert done.returncode == 0, done.stdout + done.stderr
    (wheel,) = tmp_path.glob("*.whl")
    names = set(zipfile.ZipFile(wheel).namelist())
    sources = {
        f"onedemo/{path.relative_to(ROOT)}".replace("onedemo/face/", "onedemo/")
        for folder in PACKAGES
        for path in (ROOT / folder).glob("**/*")
        if path.suffix in (".py", ".yaml", ".npz", ".safetensors", ".typed", ".xz") or path.name.startswith("LICENSE")
    }
    sources |= {f"onedemo/{path.relative_to(ROOT)}" for path in (ROOT / "configs").glob("**/*.json")}
    assert {f"onedemo/configs/{name}" for name in ("actors/README.md", "rl_zoo3/sac.yaml")} <= names
    assert sources <= names
    assert not [name for name in names if name.startswith(("tests", "onedemo/tests"))]


def test_torch_is_nowhere_in_the_core():
    assert not [need for need in PROJECT["dependencies"] if "torch" in need or "stable" in need]


def test_constraints_name_versions_and_no_hosts():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pinned = [line for line in lines if line and not line.startswith("#")]
    assert len(pinned) > 30
    assert all("==" in line and "://" not in line for line in pinned)


def listed(end: str) -> list[str]:
    """What pip is given at one end of the versions, in plain names."""
    call = [sys.executable, str(ROOT / ".ci" / "requirements.py"), end]
    lines = subprocess.run(call, capture_output=True, text=True, check=True).stdout.splitlines()
    return [line.replace("_", "-").replace(".yaml", "-yaml") for line in lines]


def test_the_oldest_versions_are_the_lower_bounds_and_everything_is_named_once():
    lines = listed("oldest")
    for need in PROJECT["dependencies"]:
        name, lowest = re.fullmatch(r"([\w.-]+)>=([\d.]+)(?:,<[\d.]+)?", need).groups()
        name = name.replace(".", "-")
        assert [line for line in lines if line.split("==")[0] == name] == [f"{name}=={lowest}"]
    assert "llvmlite" not in " ".join(lines) and "cmeel-boost==1.83.0" in lines
    markers = [line for line in lines if ";" in line]
    assert len({line.split("==")[0] for line in lines if ";" not in line}) == len(lines) - len(markers)


def test_the_newest_versions_have_no_bounds_and_no_simulator():
    lines = listed("newest")
    wanted = {re.split("[><=]", need)[0].replace(".", "-") for need in PROJECT["dependencies"]} - {"robosuite"}
    assert wanted | {"pytest"} <= set(lines) and "robosuite" not in lines
    assert not [line for line in lines if re.search("[<>=]", line)]


def test_the_changelog_speaks_of_what_comes():
    assert "## [Unreleased]" in (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
