"""The bans and sizes of the house style, kept true by reading the source."""

from __future__ import annotations

import ast
import re

import pytest
from helpers.import_graph import PACKAGES, ROOT, SOURCES, external_imports_of, tree_of

LEARNING = {"torch", "stable_baselines3", "sb3_contrib"}
MAY_USE = {"bench/workers/ray_actors.py": {"socket"}}
"""Who may use what is banned: to ask whether a cluster that the user names is there."""
BANNED_CALLS = {"eval", "exec", "compile", "__import__", "breakpoint"}
BANNED_MODULES = {"pickle", "marshal", "shelve", "dill", "joblib", "random", "requests", "urllib", "socket"}

each_source = pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))


@each_source
def test_the_project_is_imported_relatively(path):
    assert "onedemo" not in external_imports_of(path)


@each_source
def test_nothing_loads_code_or_uses_global_randomness(path):
    banned = BANNED_MODULES - MAY_USE.get(str(path.relative_to(ROOT)), set())
    assert not banned & external_imports_of(path)
    for node in ast.walk(tree_of(path)):
        if not isinstance(node, ast.Call):
            continue
        text = ast.unparse(node.func)
        assert text not in BANNED_CALLS, f"line {node.lineno}: {text}"
        assert not text.startswith("np.random.") or text == "np.random.default_rng", f"line {node.lineno}: {text}"
        keywords = {keyword.arg: ast.unparse(keyword.value) for keyword in node.keywords}
        if text == "np.load":
            assert keywords.get("allow_pickle") == "False", f"line {node.lineno}: np.load"
        if text == "YAML":
            assert keywords.get("typ") == "'safe'", f"line {node.lineno}: YAML"
        for option in ("parallel", "fastmath"):
            assert option not in keywords, f"line {node.lineno}: {option}"


@each_source
def test_libraries_neither_print_nor_swallow_errors(path):
    for node in ast.walk(tree_of(path)):
        assert not (isinstance(node, ast.ExceptHandler) and node.type is None), f"line {node.lineno}: bare except"
        assert not (isinstance(node, ast.Call) and ast.unparse(node.func) == "print"), f"line {node.lineno}: print"


@each_source
def test_libraries_for_training_are_imported_only_when_they_are_needed(path):
    top = [node for node in tree_of(path).body if isinstance(node, ast.Import | ast.ImportFrom)]
    named = {alias.name for node in top for alias in node.names} | {getattr(node, "module", None) or "" for node in top}
    assert not LEARNING & {name.split(".")[0] for name in named}


@each_source
def test_files_and_functions_stay_small(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 330
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
            assert lines <= 45, f"{node.name} has {lines} lines"


@pytest.mark.parametrize("folder", [*PACKAGES, "tests", ".ci"])
def test_no_path_of_a_machine_stands_in_the_source(folder):
    for path in (ROOT / folder).glob("**/*"):
        if path.suffix in (".py", ".yaml", ".md", ".toml", "") and path.is_file():
            text = path.read_text(encoding="utf-8")
            for word in ("/" + "home/", "/" + "root/", "/" + "work/", "/" + "Users/"):
                assert word not in text, f"{path}: {word}"


def public_functions(path):
    """Public functions, and methods of public classes, with their parameters."""
    for node in ast.walk(tree_of(path)):
        inside = isinstance(node, ast.Module) or (isinstance(node, ast.ClassDef) and not node.name.startswith("_"))
        for child in node.body if inside else ():
            if isinstance(child, ast.FunctionDef) and not child.name.startswith("_"):
                every = [*child.args.posonlyargs, *child.args.args, *child.args.kwonlyargs]
                yield child, [each.arg for each in every if each.arg not in ("self", "cls")]


@each_source
def test_public_functions_of_two_or_more_parameters_explain_each(path):
    """Commands aside, whose docstring is the text of --help, and methods of an interface explained elsewhere."""
    for node, names in public_functions(path):
        text = ast.get_docstring(node) or ""
        is_command = any("command" in ast.unparse(each) for each in node.decorator_list)
        if len(names) >= 2 and not text.startswith("See ") and not is_command:
            explained = set(re.findall(r"^ {4}(\w+): ", text.partition("Args:")[2], re.MULTILINE))
            assert set(names) <= explained, f"{node.name}: {sorted(set(names) - explained)}"


OLD_TICS = ("that is none", "of which there", "goes on", "gets on", "has come to its end", "that is well")


@each_source
def test_first_lines_are_sentences(path):
    """An imperative or a noun phrase: not a relative clause without its noun."""
    nodes = [node for node in ast.walk(tree_of(path)) if isinstance(node, ast.FunctionDef | ast.ClassDef | ast.Module)]
    for node in nodes:
        first = (ast.get_docstring(node) or "").partition("\n")[0]
        assert not re.match(r"(What|That|Whose|Which|Who|It|The same|How|Of|Whether) ", first), first
        assert not [tic for tic in OLD_TICS if tic in first], first


def test_a_class_name_stands_for_one_thing():
    places = {}
    for path in SOURCES:
        for node in tree_of(path).body:
            if isinstance(node, ast.ClassDef):
                places.setdefault(node.name, []).append(str(path.relative_to(ROOT)))
    assert not {name: files for name, files in places.items() if len(files) > 1}
