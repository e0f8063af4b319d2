"""The layers of the architecture, kept true by reading every import: those for type checking and in functions too."""

from __future__ import annotations

from collections import defaultdict

import pytest
from helpers.import_graph import MODULES, PACKAGES, ROOT, SOURCES, circles, external_imports_of, graph, layer_of

LOWER = {
    "planner": set(),
    "envs": {"planner"},
    "configs": {"planner"},
    "baselines": {"planner", "envs", "configs"},
    "bench": {"planner", "envs", "baselines", "configs"},
    "face": {"planner", "envs", "baselines", "configs"},
}
ORDER = {
    "planner": """
        errors lazy_names deferred_imports ranges arrays jit columns strict_json resumable geometry models robot
        collision fitting control imitation skills recordings log escape constraints search safety judge planning
        reactive
    """,
    "envs": """
        errors dotted_names facts mujoco_library scene simulation judge core stack pour shelve guests shipped
        registration tasks task_table
    """,
    "configs": """
        errors shipped_files dotted_keys strict_yaml dataclass_settings skill_file demonstrations run_config
        learner_arguments grid train_config plan_scene_schema plan_scene
    """,
    "baselines": """
        errors policy extras warm_up key_poses recording motion programs own_policy program_policy
        safe_actions screw_policy learning factory paths_only
    """,
    "bench": """
        console usage atomic_files statistics provenance interruption method_table drawing
        recordings demonstrations document robot metrics plan workers episodes report geometric run task_pages
        reproduce train curves perf mbm survey cli
    """,
    "face": "former_paths",
}
"""Sub-packages, and files that lie in none, from the lowest up: each imports only from those before it."""
ENVS_MAY_USE = {
    "planner.errors",
    "planner.deferred_imports",
    "planner.jit",
    "planner.geometry",
    "planner.robot",
    "planner.fitting",
}
ENVS_MAY_USE |= {"planner.collision.proximity", "planner.control.inverse_kinematics", "planner.control.linear"}
ENVS_MAY_USE |= {"planner.skills.skill"}
"""Geometry and kinematics of the planner, and the form of a skill, no method."""
SIMULATORS = {"mujoco", "robosuite", "gymnasium"}
READERS = {"planner/models/urdf_model.py", "planner/judge/geometry.py"}
USERS = {
    "robosuite": {"envs/scene/robosuite_model.py", "envs/guests/robosuite_task.py", "bench/perf/command.py"},
    "pinocchio": {*READERS, "bench/perf/peers.py", "bench/robot/urdf_solids.py"},
    "numba": {"planner/jit.py"},
    "mujoco": {"envs/mujoco_library.py"},
}
"""Who alone imports a heavy library."""
JUDGE_SHARES = {
    "planner.errors",
    "planner.arrays",
    "planner.jit",
    "planner.strict_json",
    "planner.ranges",
    "planner.columns",
    "planner.geometry",
    "planner.models",
    "planner.robot",
    "planner.log",
}
QUERIES = {
    "planner.geometry.gjk",
    "planner.geometry.convex_distance",
    "planner.geometry.convex_pieces",
    "planner.robot.resting_pairs",
}
"""In layers that the judge shares, and not for it."""
MOST_FILES = 14
"""In one folder."""


def package_of(module: str) -> str:
    return module.split(".")[0]


def test_there_is_source_to_check():
    assert len(graph()) > 200 and sum(map(len, graph().values())) > 800


def test_no_files_import_each_other_in_a_circle():
    assert circles(graph()) == []


@pytest.mark.parametrize("package", PACKAGES)
def test_packages_import_only_from_lower_packages(package):
    for module, targets in graph().items():
        if package_of(module) == package:
            for target in targets:
                assert package_of(target) in {package, *LOWER[package]}, f"{module} imports {target}"


@pytest.mark.parametrize("package", PACKAGES)
def test_layers_import_only_from_layers_below_them(package):
    order = [f"{package}.{name}" for name in ORDER[package].split()]
    assert set(order) == {layer_of(module) for module in graph() if package_of(module) == package}
    for module, targets in graph().items():
        for target in targets:
            one, other = layer_of(module), layer_of(target)
            if package_of(module) == package_of(target) == package and one != other:
                assert order.index(other) < order.index(one), f"{module} imports {target}"


def test_environments_use_only_geometry_and_kinematics_of_the_planner():
    for module, targets in graph().items():
        for target in targets if package_of(module) == "envs" else ():
            allowed = package_of(target) != "planner" or {target, layer_of(target)} & ENVS_MAY_USE
            assert allowed, f"{module} imports {target}"


def test_the_planner_knows_no_simulator():
    for path in SOURCES:
        if path.relative_to(ROOT).parts[0] == "planner":
            assert not SIMULATORS & external_imports_of(path), path.name


@pytest.mark.parametrize("library", USERS)
def test_heavy_libraries_are_touched_in_one_place(library):
    users = {str(path.relative_to(ROOT)) for path in SOURCES if library in external_imports_of(path)}
    assert users == USERS[library]


def test_the_judge_shares_no_query_with_the_planner():
    seen, todo = set(), ["planner.judge.certify"]
    while todo:
        module = todo.pop()
        if module not in seen:
            seen.add(module)
            todo += graph()[module]
    assert {layer_of(module) for module in seen} - {"planner.judge"} <= JUDGE_SHARES
    assert not seen & QUERIES
    assert set(graph()) >= QUERIES


def test_no_folder_is_crowded():
    files = defaultdict(list)
    for path in [*SOURCES, *(ROOT / "tests").glob("**/*.py")]:
        files[path.parent].append(path.name)
    assert not {str(folder.relative_to(ROOT)): len(names) for folder, names in files.items() if len(names) > MOST_FILES}


def test_faces_and_folders_are_packages():
    assert {path.parent for path in SOURCES} == {path.parent for path in MODULES.values() if path.name == "__init__.py"}
