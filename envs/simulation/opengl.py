"""OpenGL contexts of MuJoCo's offscreen backends, for every thread of the process that opened them."""

from __future__ import annotations

import atexit
import os
import sys
import threading
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from ctypes.util import find_library
from importlib import import_module
from typing import Any

from ..errors import RenderingUnavailable

BACKENDS = {"egl": "EGL", "osmesa": "OSMesa", "glfw": None}
"""MuJoCo's offscreen backends, with the library that each needs."""
ANY = ("", "enable", "enabled", "on", "true", "1")
NONE = ("disable", "disabled", "off", "false", "0")
"""Values of MUJOCO_GL, beside the backends, with which any backend may draw, or none."""
_OPENED: set[str] = set()
_INHERITED: set[str] = set()
"""What was opened in this process, and what in the one that this was forked from."""
_KEPT: list[Any] = []
_THREAD = threading.local()


class OpenGL:
    """An OpenGL context without a display, for one thread at a time.

    Raises:
        RenderingUnavailable: no context can be opened, or OpenGL was opened before this process was forked.
    """

    def __init__(self, width: int, height: int):
        self._process, self._lock = os.getpid(), threading.Lock()
        self._name, self._context = _opened(width, height)

    @contextmanager
    def current(self) -> Iterator[None]:
        """Make the context the thread's current one in the `with` block; other threads wait for its end.

        Raises:
            RenderingUnavailable: this process is a fork of the one that opened the context.
        """
        check_not_inherited()
        with self._lock:
            before = getattr(_THREAD, "current", None)
            self._context.make_current()
            _THREAD.current = self
            try:
                yield
            finally:
                # in the middle of an image, garbage may be collected, and with it another image's context
                _THREAD.current = before
                if before is None:
                    _release(self._name)
                else:
                    before._context.make_current()

    def free(self, *resources: Any) -> None:
        """Free resources and the context they lie in; in a forked process, where that would hang, keep them."""
        if os.getpid() != self._process:
            _KEPT.extend((self._context, *resources))
            return
        with self.current():
            for resource in resources:
                resource.free()
            self._context.free()


def backends() -> list[str]:
    """Return the backends to try, in order: the one named by MUJOCO_GL, else the installed ones.

    Raises:
        RenderingUnavailable: MUJOCO_GL names no backend.
    """
    wanted = os.environ.get("MUJOCO_GL", "").lower().strip()
    if wanted in BACKENDS:
        return [wanted]
    if wanted in NONE:
        raise RenderingUnavailable(f"MUJOCO_GL={wanted} turns pictures off", "unset it")
    if wanted not in ANY:
        raise RenderingUnavailable(f"MUJOCO_GL={wanted} is unknown", f"allowed are {', '.join(BACKENDS)}, or unset it")
    found = [name for name, library in BACKENDS.items() if library and find_library(library)]
    return found[:1] + (["glfw"] if os.environ.get("DISPLAY") else [])


def note_opened(what: str) -> None:
    """Note that something was opened that does not survive a fork."""
    _OPENED.add(what)


def check_not_inherited() -> None:
    """Refuse to draw in a process that was forked after something had been drawn.

    The drivers' threads are missing there: drawing waits for them for ever.

    Raises:
        RenderingUnavailable: this is such a process.
    """
    if _INHERITED:
        raise RenderingUnavailable(
            "OpenGL was opened before this process was forked, and does not survive that",
            'start processes by "spawn" or "forkserver", or draw nothing before the fork',
        )


def _note_fork() -> None:
    egl: Any = sys.modules.get("mujoco.egl")
    _INHERITED.update(_OPENED)
    if getattr(egl, "EGL_DISPLAY", None) is not None:  # MuJoCo's own renderer may have opened it
        _INHERITED.add("egl")
        atexit.unregister(egl.EGL.eglTerminate)


os.register_at_fork(after_in_child=_note_fork)


def _opened(width: int, height: int) -> tuple[str, Any]:
    """Return the name and the context of the first backend that works."""
    check_not_inherited()
    reasons = []
    for name in backends():
        try:
            context = _context(name, width, height)
        except Exception as error:  # the backends raise whatever their libraries do
            reasons.append(f"{name}: {_reason(name, error)}")
        else:
            note_opened(name)
            return name, context
    raise RenderingUnavailable("; ".join(reasons) or "no OpenGL library found")


def _context(name: str, width: int, height: int) -> Any:
    kind = import_module(f"mujoco.{name}").GLContext
    context = kind.__new__(kind)
    context._context = None  # looked for by its destructor, even where its constructor has failed
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        context.__init__(width, height)
    if not context._context:
        raise OSError(said[0].message if said else "no context")
    return context


def _reason(name: str, error: Exception) -> str:
    library = BACKENDS[name]
    if library and not find_library(library):  # what PyOpenGL then raises says nothing
        return f"there is no library {library}"
    return " ".join(str(error).split())


def _release(name: str) -> None:
    """Give up the thread's current context, so that another thread can use it."""
    library: Any = import_module(f"mujoco.{name}")
    if name == "egl":
        library.EGL.eglReleaseThread()
    elif name == "osmesa":
        library.osmesa.OSMesaMakeCurrent(None, None, library.GL.GL_FLOAT, 0, 0)
    else:
        library.glfw.make_context_current(None)
