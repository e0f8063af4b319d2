"""Which file of the project imports which, read from the sources: every import, wherever it stands."""

from __future__ import annotations

import ast
from collections.abc import Iterable
from functools import cache
from pathlib import Path

ROOT = Path(__file__).parents[2]
PACKAGES = ("face", "planner", "envs", "baselines", "configs", "bench")
SOURCES = tuple(sorted(path for package in PACKAGES for path in (ROOT / package).glob("**/*.py")))


def module_of(path: Path) -> str:
    """Dotted name of a file, like "planner.geometry.pose"; that of a folder for its `__init__`."""
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


MODULES = {module_of(path): path for path in SOURCES}


@cache
def tree_of(path: Path) -> ast.Module:
    """The parsed file."""
    return ast.parse(path.read_text(encoding="utf-8"))


def base_of(path: Path, node: ast.ImportFrom) -> str:
    """Dotted name of what a relative import imports from; "" for the root of the project."""
    package = path.relative_to(ROOT).parts[:-1]
    package = () if package == ("face",) else package  # it is installed as the root
    return ".".join([*package[: len(package) - node.level + 1], *(node.module.split(".") if node.module else [])])


@cache
def imports_of(path: Path) -> frozenset[str]:
    """Modules of the project that a file imports: those of the names, not the faces that names are imported through."""
    found = set()
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.ImportFrom) and node.level:
            base = base_of(path, node)
            found |= {target_of(base, alias.name) for alias in node.names}
    return frozenset(found - {module_of(path)})


def target_of(base: str, name: str) -> str:
    """The module that gives a name: a sub-module, the module that a face takes it from, or the module itself."""
    module = f"{base}.{name}" if base else name if name in MODULES else f"face.{name}"
    if module in MODULES:
        return module
    path = MODULES[base or "face"]
    if path.name == "__init__.py":
        for node in ast.walk(tree_of(path)):
            if isinstance(node, ast.ImportFrom) and name in [alias.name for alias in node.names]:
                return target_of(base_of(path, node), name)
    return base


def external_imports_of(path: Path) -> set[str]:
    """Top names of everything else that a file imports."""
    found = set()
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.Import):
            found |= {alias.name.split(".")[0] for alias in node.names}
        elif isinstance(node, ast.ImportFrom) and not node.level and node.module:
            found.add(node.module.split(".")[0])
    return found


@cache
def graph() -> dict[str, frozenset[str]]:
    """Module: the modules it imports; without the faces, which import everything below them when asked for it."""
    files = {name: path for name, path in MODULES.items() if path.name != "__init__.py"}
    return {name: frozenset(imports_of(path) & set(files)) for name, path in files.items()}


def layer_of(module: str) -> str:
    """The sub-package of a module, or the module itself where it lies in no sub-package."""
    return ".".join(module.split(".")[:2])


def circles(arrows: dict[str, Iterable[str]]) -> list[list[str]]:
    """Groups of nodes that reach each other (Tarjan's strongly connected components of more than one)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    found: list[list[str]] = []

    def visit(node: str) -> None:
        index[node] = low[node] = len(index)
        stack.append(node)
        for other in arrows.get(node, ()):
            if other not in index:
                visit(other)
                low[node] = min(low[node], low[other])
            elif other in stack:
                low[node] = min(low[node], index[other])
        if low[node] == index[node]:
            group = stack[stack.index(node) :]
            del stack[stack.index(node) :]
            if len(group) > 1:
                found.append(sorted(group))

    for node in arrows:
        if node not in index:
            visit(node)
    return found
