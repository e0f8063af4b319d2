"""The floors of the architecture and the bans, kept true by reading the source."""

from __future__ import annotations

import ast
from pathlib import Path

import pytest

ROOT = Path(__file__).parent.parent
FOLDERS = ("planner", "envs", "baselines", "configs", "bench")
SOURCES = sorted(path for folder in FOLDERS for path in (ROOT / folder).glob("**/*.py"))
LOWER = {
    "planner": set(),
    "envs": {"planner"},
    "baselines": {"planner", "envs", "configs"},
    "configs": {"planner"},
    "bench": {"planner", "envs", "baselines", "configs"},
}
ENVS_MAY_USE = {"errors", "dualquat", "pose", "arm", "jit", "chain", "screw", "shapes", "body", "body_models"}
ENVS_MAY_USE |= {"proximity", "ik", "models", "linear"}
"""The planner's lowest floor: geometry and kinematics, no method."""
PLANNER_ORDER = [
    "errors",
    "jit",
    "screw",
    "linear",
    "dualquat",
    "pose",
    "shapes",
    "hulls",
    "cover",
    "chain",
    "models",
    "arm",
    "body",
    "links",
    "body_models",
    "workspace",
    "controller",
    "pursuit",
    "ik",
    "tsia",
    "bimanual",
    "smooth",
    "timing",
    "motions",
    "gjk",
    "proximity",
    "qp",
    "robot_work",
    "clearance",
    "own_pairs",
    "barrier",
    "safety",
    "guarded",
    "tangent",
    "heap",
    "edges",
    "escape_tree",
    "escape",
    "repet",
    "scene_work",
    "joint_search",
    "joint_leg",
    "refine",
    "leg",
    "plans",
    "attempts",
    "planning",
    "command",
    "foresight",
    "reactive",
    "segment",
    "warm",
    "demo",
    "demo_io",
    "recordings",
    "strict_json",
    "log_parts",
    "motion_log",
    "judge_geometry",
    "judge_deviation",
    "judge_sweep",
    "certify",
]
ENVS_ORDER = [
    "things",
    "task",
    "layouts",
    "options",
    "spaces",
    "state",
    "shaping",
    "progress",
    "servos",
    "trunk",
    "model_parts",
    "table_model",
    "robots",
    "arm_index",
    "static_shapes",
    "scene",
    "beads",
    "bodies",
    "obstacles",
    "nearness",
    "rooms",
    "robot_parts",
    "placement",
    "levels",
    "sim",
    "twists",
    "render",
    "base",
    "subtask",
    "in_hand",
    "stack_rules",
    "stack_places",
    "stacking",
    "reach_rules",
    "reaching",
    "placing",
    "shelf_parts",
    "shelf_places",
    "shelf_layouts",
    "shelf_options",
    "shelve_rules",
    "shelving",
    "inserting",
    "pour_geometry",
    "pour_places",
    "pour_layouts",
    "pour_rules",
    "pouring",
    "tilting",
    "bimanual_pouring",
    "registration",
    "__init__",
]
SIMULATORS = {"mujoco", "robosuite", "gymnasium"}
READERS = {"planner/models.py", "planner/body_models.py", "planner/judge_geometry.py"}
ONE_FILE = {"robosuite": {"envs/table_model.py", "bench/perf.py"}, "pinocchio": {*READERS, "bench/peers.py"}}
LEARNING = {"torch", "stable_baselines3", "sb3_contrib"}
MAY_USE = {"bench/ray_actors.py": {"socket"}}
"""Who may use what is banned: to ask whether a cluster that the user names is there."""
BANNED_CALLS = {"eval", "exec", "compile", "__import__", "breakpoint"}
BANNED_MODULES = {"pickle", "marshal", "shelve", "dill", "joblib", "random", "requests", "urllib", "socket"}

each_source = pytest.mark.parametrize("path", SOURCES, ids=lambda path: str(path.relative_to(ROOT)))


def tree_of(path: Path) -> ast.Module:
    return ast.parse(path.read_text(encoding="utf-8"))


def is_type_checking(node: ast.AST) -> bool:
    return isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING"


def imports_of(path: Path) -> list[tuple[str, str]]:
    """(folder, module) of every import from the project, ("", name) of every other, type checking aside."""
    tree = tree_of(path)
    hidden = {
        (child.lineno, child.col_offset)
        for node in ast.walk(tree)
        if is_type_checking(node)
        for child in ast.walk(node)
        if isinstance(child, ast.ImportFrom | ast.Import)
    }
    found = []
    for node in ast.walk(tree):
        if isinstance(node, ast.Import) and (node.lineno, node.col_offset) not in hidden:
            found += [("", alias.name.split(".")[0]) for alias in node.names]
        elif isinstance(node, ast.ImportFrom) and (node.lineno, node.col_offset) not in hidden:
            found += imported_from(path, node)
    return found


def imported_from(path: Path, node: ast.ImportFrom) -> list[tuple[str, str]]:
    parts = (node.module or "").split(".") if node.module else []
    if node.level == 0:
        return [("", parts[0])]
    if node.level == 1:
        names = [parts[0]] if parts else [alias.name for alias in node.names]
        return [(path.parent.name, name) for name in names]
    if len(parts) >= 2:
        return [(parts[0], parts[1])]
    if parts:
        return [(parts[0], alias.name) for alias in node.names]
    return [(alias.name, "__init__") for alias in node.names]


def test_there_is_source_to_check():
    assert len(SOURCES) > 40


@each_source
def test_folders_import_only_from_lower_folders(path):
    own = path.parent.name
    for folder, module in imports_of(path):
        assert folder in ("", own) or folder in LOWER[own], f"{own} imports {folder}.{module}"


@each_source
def test_the_project_is_imported_relatively(path):
    assert ("", "onedemo") not in imports_of(path)


@pytest.mark.parametrize("folder, order", [("planner", PLANNER_ORDER), ("envs", ENVS_ORDER)])
def test_files_import_only_from_files_above_them(folder, order):
    files = {path.stem for path in (ROOT / folder).glob("*.py")}
    assert files - {"__init__"} == set(order) - {"__init__"}
    for stem in set(order) & files:
        for other, module in imports_of(ROOT / folder / f"{stem}.py"):
            if other == folder:
                assert order.index(module) < order.index(stem), f"{stem} imports {module}"


def test_environments_use_only_the_lowest_floor_of_the_planner():
    for path in (ROOT / "envs").glob("*.py"):
        for folder, module in imports_of(path):
            assert folder != "planner" or module in ENVS_MAY_USE, f"{path.name} imports planner.{module}"


def test_the_planner_knows_no_simulator():
    for path in (ROOT / "planner").glob("*.py"):
        assert not SIMULATORS & {module for folder, module in imports_of(path) if folder == ""}, path.name


@pytest.mark.parametrize("library", ONE_FILE)
def test_heavy_libraries_are_touched_in_one_place(library):
    users = {str(path.relative_to(ROOT)) for path in SOURCES if ("", library) in imports_of(path)}
    assert users == ONE_FILE[library]


@each_source
def test_nothing_loads_code_or_uses_global_randomness(path):
    banned = BANNED_MODULES - MAY_USE.get(str(path.relative_to(ROOT)), set())
    assert not banned & {module for folder, module in imports_of(path) if folder == ""}
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


def test_the_judge_shares_no_query_with_the_planner():
    seen, todo = set(), ["certify"]
    while todo:
        stem = todo.pop()
        if stem not in seen:
            seen.add(stem)
            todo += [module for folder, module in imports_of(ROOT / "planner" / f"{stem}.py") if folder == "planner"]
    assert not seen & {"proximity", "gjk", "clearance", "robot_work", "edges", "safety", "escape", "joint_search"}


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


def test_only_the_compiler_module_talks_to_numba():
    users = {str(path.relative_to(ROOT)) for path in SOURCES if ("", "numba") in imports_of(path)}
    assert users == {"planner/jit.py"}


@each_source
def test_files_and_functions_stay_small(path):
    text = path.read_text(encoding="utf-8")
    assert text.count("\n") <= 330
    for node in ast.walk(tree_of(path)):
        if isinstance(node, ast.FunctionDef):
            body = node.body[1:] if ast.get_docstring(node) else node.body
            lines = body[-1].end_lineno - body[0].lineno + 1 if body else 0
            assert lines <= 45, f"{node.name} has {lines} lines"


@pytest.mark.parametrize("folder", [*FOLDERS, "tests", ".ci"])
def test_no_path_of_a_machine_stands_in_the_source(folder):
    for path in (ROOT / folder).glob("**/*"):
        if path.suffix in (".py", ".yaml", ".md", ".toml", "") and path.is_file():
            text = path.read_text(encoding="utf-8")
            for word in ("/" + "home/", "/" + "root/", "/" + "work/", "/" + "Users/"):
                assert word not in text, f"{path}: {word}"
