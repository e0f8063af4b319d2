"""Import paths of version 0.1.0 that README and docs named: they work for one more version, with a warning."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Sequence
from importlib import import_module
from importlib.abc import Loader, MetaPathFinder
from importlib.machinery import ModuleSpec
from types import ModuleType
from typing import Any

MOVED = {
    "baselines.actor_io": "baselines.learning.actor_files",
    "baselines.export": "baselines.learning.export_actor",
    "baselines.features": "baselines.learning.features",
    "baselines.flat_features": "baselines.learning.feature_scaling",
    "baselines.geometric": "baselines.paths_only",
    "baselines.learned": "baselines.learning.learned_policy",
    "baselines.makers": "baselines.motion.path_generators",
    "baselines.residual": "baselines.learning.residual_policy",
    "baselines.task_episodes": "baselines.learning.task_demonstrations",
    "configs.shipped": "configs.shipped_files",
    "envs.pour_places": "envs.pour.places",
    "envs.robots": "envs.scene.robots",
    "envs.shelf_places": "envs.shelve.places",
    "envs.task": "envs.core.description",
    "planner.arm": "planner.robot.arm",
    "planner.body_models": "planner.fitting.body_readers",
    "planner.certify": "planner.judge.certify",
    "planner.controller": "planner.control.controller",
    "planner.demo": "planner.imitation.demonstration",
    "planner.demo_io": "planner.imitation.demonstration_files",
    "planner.pose": "planner.geometry.pose",
}
"""Former module: present module."""
RENAMED = {
    ("baselines.geometric", "leg_planner"): "motion_planner",
    ("baselines.makers", "Maker"): "PathGenerator",
    ("baselines.makers", "Made"): "GeneratedPath",
    ("planner.demo_io", "load_demonstration"): "read_demonstration",
}
"""Former module and name: present name, where it differs."""


class FormerModule(ModuleType):
    """A module under its former path; it gives the names of the present one."""

    def __getattr__(self, name: str) -> Any:
        """Return an attribute of the present module."""
        if name == "__all__":
            return dir(self)
        former = self.__name__.partition(".")[2]
        return getattr(import_module(f"{__package__}.{MOVED[former]}"), RENAMED.get((former, name), name))

    def __dir__(self) -> list[str]:
        """Return the public names of the present module, and former names."""
        former = self.__name__.partition(".")[2]
        present = vars(import_module(f"{__package__}.{MOVED[former]}"))
        return sorted(
            {*(key for key in present if not key.startswith("_")), *(old for m, old in RENAMED if m == former)}
        )

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        """Call the function of the module's own name, like `certify`, whose public name the module hides."""
        return getattr(self, self.__name__.rpartition(".")[2])(*arguments, **options)


class FormerPaths(MetaPathFinder, Loader):
    """Finds modules by their former paths; asked only when nothing else finds them."""

    def find_spec(
        self, fullname: str, path: Sequence[str] | None = None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        """Return a spec for a former path, else None; see `MetaPathFinder`.

        Args:
            fullname: dotted name of the module.
            path: not used.
            target: not used.
        """
        root, _, name = fullname.partition(".")
        return ModuleSpec(fullname, self) if root == __package__ and name in MOVED else None

    def exec_module(self, module: ModuleType) -> None:
        """Let the module hand out the names of the present one."""
        present = f"{__package__}.{MOVED[module.__name__.partition('.')[2]]}"
        package = ".".join(present.split(".")[:2])
        words = f"{module.__name__} is now {present}; public names are best imported from {package}"
        warnings.warn(words, DeprecationWarning, stacklevel=2)
        module.__class__ = FormerModule


def keep() -> None:
    """Make the former paths importable; repeated calls do no harm."""
    if not any(type(finder).__name__ == FormerPaths.__name__ for finder in sys.meta_path):
        sys.meta_path.append(FormerPaths())
