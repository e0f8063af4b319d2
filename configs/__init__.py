"""Settings as data: strict YAML, shipped configs, demonstrations and actors.

The names below are the public face; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..planner.lazy_names import lazy_names

if TYPE_CHECKING:
    from .demonstrations import load_demonstration as load_demonstration
    from .errors import BadConfig as BadConfig
    from .grid import Grid as Grid
    from .grid import load_config as load_config
    from .grid import load_grid as load_grid
    from .run_config import RunConfig as RunConfig
    from .shipped_files import (
        shipped_actor as shipped_actor,
    )
    from .shipped_files import (
        shipped_config as shipped_config,
    )
    from .shipped_files import (
        shipped_demonstration as shipped_demonstration,
    )
    from .shipped_files import (
        shipped_training as shipped_training,
    )
    from .train_config import TrainConfig as TrainConfig
    from .train_config import load_training as load_training

__all__ = [
    "BadConfig",
    "Grid",
    "RunConfig",
    "TrainConfig",
    "load_config",
    "load_demonstration",
    "load_grid",
    "load_training",
    "shipped_actor",
    "shipped_config",
    "shipped_demonstration",
    "shipped_training",
]

if not TYPE_CHECKING:  # a type checker would take any name for known
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".errors": ("BadConfig",),
            ".grid": (
                "Grid",
                "load_config",
                "load_grid",
            ),
            ".demonstrations": ("load_demonstration",),
            ".run_config": ("RunConfig",),
            ".shipped_files": (
                "shipped_actor",
                "shipped_config",
                "shipped_demonstration",
                "shipped_training",
            ),
            ".train_config": (
                "TrainConfig",
                "load_training",
            ),
        },
    )
