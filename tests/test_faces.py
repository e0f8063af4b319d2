"""The public names of the packages: complete, lazy, and the ones that README and docs use."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
import warnings
from importlib import import_module

import pytest
from helpers.import_graph import MODULES, PACKAGES, ROOT, SOURCES, base_of, module_of, tree_of

import onedemo

FACES = ("", "planner", "envs", "baselines", "configs")
HEAVY = ("numba", "mujoco", "robosuite", "pinocchio", "fcl", "torch")
PAGES = [ROOT / "README.md", *sorted((ROOT / "docs").glob("**/*.md"))]
SNIPPET = re.compile(r"```python\n(.*?)```", re.DOTALL)
PRESENT = ["planner.planning.Planner", "planner.reactive.ReactivePlanner"]
"""Names of former modules that are packages now."""


def package_of(face: str):
    return import_module(f"onedemo.{face}" if face else "onedemo")


def declared_in(face: str) -> dict[str, str]:
    """Name: module, as type checkers see the face."""
    path = ROOT / (face or "face") / "__init__.py"
    found = {}
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and any(alias.asname == alias.name for alias in node.names):
            found |= {alias.name: base_of(path, node) for alias in node.names if alias.asname}
    return found


@pytest.mark.parametrize("face", FACES)
def test_all_names_exist_and_are_listed_wherever_they_are_looked_for(face):
    package, declared = package_of(face), declared_in(face)
    assert len(package.__all__) == len(set(package.__all__))
    eager = {"__version__"} if not face else {"IDS", "TASKS", "register_all"} if face == "envs" else set()
    assert set(package.__all__) == set(declared) | eager
    assert set(package.__all__) <= set(dir(package))
    for name in package.__all__:
        assert getattr(package, name) is not None
    for name, module in declared.items():
        assert getattr(package, name) is getattr(import_module(f"onedemo.{module}"), name)
    with pytest.raises(AttributeError, match="has no attribute 'Nonsense'"):
        package.Nonsense  # noqa: B018


@pytest.mark.parametrize("face", FACES)
def test_importing_a_face_imports_neither_compiler_nor_simulator(face):
    name = f"onedemo.{face}" if face else "onedemo"
    code = f"import sys, {name}; print(sorted({HEAVY!r} & sys.modules.keys()))".replace(repr(HEAVY), repr(set(HEAVY)))
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_the_version_is_that_of_the_distribution():
    from importlib.metadata import version

    assert onedemo.__version__ == version("onedemo")


def test_the_packages_are_attributes_of_the_root():
    code = "import onedemo; print(onedemo.envs.IDS['onedemo/Stack-v0'].seconds, sorted(dir(onedemo)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith(
        "60.0 ['OneDemoError', 'Task', '__version__', 'baselines', 'configs', 'envs', 'load_demonstration'"
    )


def snippets() -> list:
    found = []
    for page in PAGES:
        for k, text in enumerate(SNIPPET.findall(page.read_text(encoding="utf-8"))):
            found.append(pytest.param(text, id=f"{page.relative_to(ROOT)}-{k}"))
    return found


@pytest.mark.parametrize("text", snippets())
def test_snippets_of_readme_and_docs_import_from_faces(text):
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("onedemo"):
            face = node.module.partition(".")[2]
            assert face in FACES, f"line {node.lineno}: {node.module}"
            assert {alias.name for alias in node.names} <= set(package_of(face).__all__)


@pytest.mark.parametrize("package", PACKAGES)
def test_across_packages_names_of_a_face_are_imported_from_it(package):
    """But for files with kernels, which import module by module."""
    faces = {face: set(declared_in(face)) for face in FACES if face}
    for path in SOURCES:
        if path.relative_to(ROOT).parts[0] != package or package == "face" or path.name == "__init__.py":
            continue
        nodes = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.ImportFrom) and node.level]
        has_kernels = any(base_of(path, node) == "planner.jit" for node in nodes)
        for node in nodes:
            base = base_of(path, node)
            other = base.split(".")[0]
            if other == package or other not in faces:
                continue
            names = {alias.name for alias in node.names} & faces[other]
            if has_kernels:
                assert base not in faces, f"{path.name}, line {node.lineno}: a face would hide what kernels call"
            elif base != other:
                assert not names, f"{path.name}, line {node.lineno}: {names} are on the face of {other}"


def test_kernels_are_imported_module_by_module():
    """So that a kernel's cache notices every change of what it calls, however its imports are written."""
    for path in SOURCES:
        nodes = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.ImportFrom) and node.level]
        if any(base_of(path, node) == "planner.jit" for node in nodes):
            for node in nodes:
                base = base_of(path, node)
                for alias in node.names:
                    target = f"{base}.{alias.name}" if f"{base}.{alias.name}" in MODULES else base
                    assert MODULES[target].name != "__init__.py", f"{module_of(path)} imports {base}.{alias.name}"


def former_paths() -> list[str]:
    from onedemo.former_paths import MOVED

    return sorted(MOVED)


@pytest.mark.parametrize("former", former_paths())
def test_former_paths_work_with_a_warning(former):
    from onedemo.former_paths import MOVED, RENAMED

    present = import_module(f"onedemo.{MOVED[former]}")
    name = next(name for name in dir(present) if not name.startswith("_") and getattr(present, name, None) is not None)
    code = (
        f"import warnings; warnings.simplefilter('error')\n"
        f"try:\n    from onedemo.{former} import {name}\n"
        f"except DeprecationWarning as warning:\n    print(warning)\n"
        f"warnings.simplefilter('ignore')\n"
        f"from onedemo.{former} import {name} as one\nfrom onedemo.{MOVED[former]} import {name} as other\n"
        f"assert one is other"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.startswith(
        f"onedemo.{former} is now onedemo.{MOVED[former]}; public names are best imported from"
    )
    for (module, old), new in RENAMED.items():
        if module == former:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                assert getattr(import_module(f"onedemo.{former}"), old) is getattr(present, new)


@pytest.mark.parametrize("name", PRESENT)
def test_former_names_of_modules_that_are_packages_now_work_with_a_warning(name):
    module, _, name = name.rpartition(".")
    with pytest.warns(DeprecationWarning, match=f"is now onedemo.planner.{name}"):
        assert getattr(import_module(f"onedemo.{module}"), name) is getattr(package_of("planner"), name)


def test_a_former_module_does_not_hide_a_public_name():
    code = "import onedemo.planner.certify, onedemo.planner; print(onedemo.planner.certify('log'))"
    done = subprocess.run([sys.executable, "-W", "ignore", "-c", code], capture_output=True, text=True)
    assert "log is 'log', a str; expected a MotionLog" in done.stderr


def test_nothing_of_the_project_uses_former_paths():
    from onedemo.former_paths import MOVED

    for path in [*SOURCES, *(ROOT / "tests").glob("**/*.py")]:
        if path.name not in ("former_paths.py", "test_faces.py"):
            for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
                if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("onedemo."):
                    assert node.module.partition(".")[2] not in MOVED, f"{path.name}, line {node.lineno}"


def test_type_checkers_see_what_python_sees(tmp_path):
    """In a tree as it is installed."""
    (tmp_path / "onedemo").mkdir()
    for package in PACKAGES:
        if package != "face":
            (tmp_path / "onedemo" / package).symlink_to(ROOT / package)
    for file in (ROOT / "face").glob("*"):
        if file.is_file():
            (tmp_path / "onedemo" / file.name).symlink_to(file)
    lines = ["import onedemo, onedemo.baselines, onedemo.configs, onedemo.envs, onedemo.planner"]
    for face in FACES:
        dotted = f"onedemo.{face}" if face else "onedemo"
        lines += [f"{dotted}.{name}" for name in package_of(face).__all__]
    (tmp_path / "uses.py").write_text("\n".join([*lines, "onedemo.planner.Nonsense  # the last line", ""]))
    (tmp_path / "pyrightconfig.json").write_text('{"include": ["uses.py"], "reportUnusedExpression": false}')
    call = [sys.executable, "-m", "pyright", "--pythonpath", sys.executable, "-p", str(tmp_path)]
    done = subprocess.run(call, capture_output=True, text=True)
    if "No module named pyright" in done.stderr:
        pytest.skip("needs pyright")
    errors = [line for line in done.stdout.splitlines() if " error: " in line]
    assert len(errors) == 1 and f"uses.py:{len(lines) + 1}:" in errors[0], done.stdout
