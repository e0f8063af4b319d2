"""MuJoCo as all modules import it: without its drawing library, and reading models alike in every locale."""

from __future__ import annotations

import locale
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from ..planner.deferred_imports import deferred

# at import MuJoCo loads the library that MUJOCO_GL names, and fails where it is missing
with deferred("mujoco.rendering.classic.gl_context:GLContext"):
    import mujoco as mujoco


def compiled_model(source: str | Path) -> mujoco.MjModel:
    """Return a compiled model.

    Args:
        source: text of an MJCF model, or the path of a model file.

    Raises:
        ValueError: MuJoCo's reason, of several lines.
    """
    with decimal_points():
        if isinstance(source, Path):
            return mujoco.MjModel.from_xml_path(str(source))
        return mujoco.MjModel.from_xml_string(source)


@contextmanager
def decimal_points() -> Iterator[None]:
    """Let MuJoCo read numbers with a decimal point in the `with` block.

    A program that has set its user's locale, as those with windows do, may have a decimal comma: MuJoCo's OBJ reader
    then cuts every coordinate at its point. A locale is the whole process's, so one with a point is left alone.
    """
    before = locale.setlocale(locale.LC_NUMERIC)
    if locale.localeconv()["decimal_point"] == ".":
        yield
        return
    # the process may have read the same files already, in its own locale
    mujoco.mj_clearCache(mujoco.mj_getCache())
    locale.setlocale(locale.LC_NUMERIC, "C")
    try:
        yield
    finally:
        locale.setlocale(locale.LC_NUMERIC, before)
