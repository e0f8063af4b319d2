"""The page and the picture of the architecture, and how to add something: true of today's sources."""

from __future__ import annotations

import ast
import builtins
import re
from functools import cache
from importlib import import_module

import pytest
from draw_architecture import BANDS, PICTURE, arrows_of, picture, sub_packages
from helpers.import_graph import MODULES, PACKAGES, ROOT, SOURCES, external_imports_of, graph, layer_of, tree_of

PAGE = (ROOT / "docs" / "architecture.md").read_text(encoding="utf-8")
GUIDE = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
ROW = re.compile(r"^\| `([a-z_.]+)` \| (.+?) \| (.+?) \|$", re.MULTILINE)
FLOW = re.compile(r"^- \*\*.+?\*\*: (.+)$", re.MULTILINE)
ARROW = re.compile(r" —`([^`]+)`→ ")
CODE = re.compile(r"`([^`\n]+)`")
FILE = re.compile(r"[\w.-]+(/[\w.-]+)+/?|[\w-]+/|\w+\.(py|md|svg|yaml|json|toml|txt)")
NAME = re.compile(r"[A-Za-z_]\w*(\.\w+)*")


def nodes_of(tree: ast.Module):
    """Name, like "Class.method", and node of all that a file defines."""
    for node in tree.body:
        for name in names_of(node):
            yield name, node
        for inner in node.body if isinstance(node, ast.ClassDef) else ():
            for name in names_of(inner):
                yield f"{node.name}.{name}", inner


def names_of(node: ast.stmt) -> list[str]:
    if isinstance(node, ast.FunctionDef | ast.ClassDef):
        return [node.name]
    targets = node.targets if isinstance(node, ast.Assign) else [node.target] if isinstance(node, ast.AnnAssign) else []
    return [each.id for target in targets for each in ast.walk(target) if isinstance(each, ast.Name)]


@cache
def defined() -> dict[str, list[ast.stmt]]:
    """Name, with and without its module in front: the nodes that define it."""
    found: dict[str, list[ast.stmt]] = {}
    for module, path in MODULES.items():
        for name, node in nodes_of(tree_of(path)):
            for each in (name, f"{module}.{name}"):
                found.setdefault(each, []).append(node)
    return found


@cache
def names_of_tests() -> set[str]:
    """Test functions, and constants of files of tests."""
    texts = [path.read_text(encoding="utf-8") for path in (ROOT / "tests").glob("**/*.py")]
    return {
        name for text in texts for name in re.findall(r"^(?:def (?=test_))?(test_\w+|[A-Z_]+)\b", text, re.MULTILINE)
    }


@cache
def libraries() -> set[str]:
    return {name for path in SOURCES for name in external_imports_of(path)}


def is_known(name: str) -> bool:
    """True if a dotted name is of the code, its tests or a library that it uses; or a command."""
    if name.startswith("onedemo "):
        words = name.split()[1:3]  # of a group of commands, like `robot`, the second names it
        known = {path for word in words for path in (f"bench.cli.{word}", f"bench.{word}.options.{word}")}
        return bool(known & defined().keys())
    first, _, rest = name.removeprefix("onedemo.").partition(".")
    if first in libraries():
        return not rest or hasattr(import_module(first), rest)
    layers = {layer.split(".")[1] for package in PACKAGES for layer in sub_packages(package)}
    known = (
        name in MODULES
        or name.removeprefix("onedemo.") in MODULES
        or name in layers | names_of_tests()
        or name in defined()
    )
    return known or name == "onedemo" or hasattr(builtins, name)


def test_the_picture_is_what_is_imported_today():
    assert PICTURE.read_text(encoding="utf-8") == picture(), "run: make picture"
    assert "](architecture.svg)" in PAGE


def test_every_package_is_in_the_picture():
    assert sorted(BANDS) == sorted(PACKAGES)


def expected_row(layer: str) -> tuple[str, str, str]:
    """What the page says about a sub-package: name, first line of its docstring, and what it may import."""
    package = layer.split(".")[0]
    others = {target.split(".")[0] for module in graph() if layer_of(module) == layer for target in graph()[module]}
    own = [f"`{each.split('.')[1]}`" for each in sorted(arrows_of(package)[layer])]
    packages = [f"`{each}`" for each in BANDS if each in others - {package}]
    holds = (ast.get_docstring(tree_of(MODULES[layer])) or "").partition("\n")[0]
    return layer, holds, "; ".join(filter(None, [", ".join(own), ", ".join(packages)])) or "–"


@pytest.mark.parametrize("layer", [layer for package in PACKAGES for layer in sub_packages(package)])
def test_every_sub_package_is_in_the_table(layer):
    assert [row for row in ROW.findall(PAGE) if row[0] == layer] == [expected_row(layer)]


def test_nothing_else_is_in_the_table():
    assert {row[0] for row in ROW.findall(PAGE)} <= {layer for package in PACKAGES for layer in sub_packages(package)}


def returned(node: ast.FunctionDef | ast.ClassDef) -> set[str]:
    """The names in what a function is declared to return; a class returns itself."""
    words = (
        node.name if isinstance(node, ast.ClassDef) else "Any" if node.returns is None else ast.unparse(node.returns)
    )
    return set(re.findall(r"\w+", words))


def test_there_are_five_data_flows():
    assert [len(ARROW.findall(flow)) >= 5 for flow in FLOW.findall(PAGE)] == [True] * 5


@pytest.mark.parametrize("flow", FLOW.findall(PAGE))
def test_each_arrow_of_a_data_flow_is_a_function_that_returns_what_it_points_to(flow):
    _, *steps = ARROW.split(flow)
    for verb, result in zip(steps[::2], steps[1::2], strict=True):
        found = [node for node in defined().get(verb, []) if isinstance(node, ast.FunctionDef | ast.ClassDef)]
        assert found, f"there is no {verb}"
        kinds = CODE.findall(result)
        assert len(kinds) <= 1 and all(map(is_known, kinds)), result
        for kind in kinds:
            assert any({kind.split(".")[-1], "Any"} & returned(node) for node in found), f"{verb} returns no {kind}"


@pytest.mark.parametrize("code", sorted(set(CODE.findall(PAGE))))
def test_all_that_the_page_names_exists(code):
    assert exists(code) if FILE.fullmatch(code) or code.startswith("make ") else is_known(code)


@pytest.mark.parametrize("code", sorted(set(CODE.findall(GUIDE))))
def test_all_that_the_guide_names_exists(code):
    """Files, targets, commands, and the names of classes, tables and tests."""
    words = code.split()
    if words[0] == "make" or FILE.fullmatch(code):
        assert exists(code)
    elif words[0] == "python":
        assert exists(words[1])
    elif NAME.fullmatch(code) and (code[0].isupper() or code.startswith("test_") or "." in code):
        assert is_known(code)


def exists(code: str) -> bool:
    """True if there is such a file, folder or target of make."""
    if code.startswith("make "):
        return f"\n{code.removeprefix('make ')}:" in (ROOT / "Makefile").read_text(encoding="utf-8")
    return (ROOT / code).is_dir() if code.endswith("/") else (ROOT / code).exists()


@pytest.mark.parametrize(
    "name", ["Planner.plans", "planner.geometry.posse", "robosuit", "test_nothing", "gymnasium.mak"]
)
def test_a_name_that_does_not_exist_is_noticed(name):
    assert not is_known(name) and not exists("docs/" + name)
