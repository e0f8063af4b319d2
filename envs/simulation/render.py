"""Images and a window of a simulation; OpenGL is not touched before the first image."""

from __future__ import annotations

import atexit
import logging
import os
import weakref
from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import numpy as np

from ...planner import Shape
from ..errors import RenderingUnavailable
from ..mujoco_library import mujoco
from ..scene.scene_objects import half_sizes
from .opengl import OpenGL, check_not_inherited, note_opened

LOGGER = logging.getLogger(__name__)
WIDTH, HEIGHT = 640, 480
GHOST_COLOR = (0.35, 0.55, 0.95, 0.16)


@dataclass(frozen=True)
class View:
    """Camera view.

    Attributes:
        look_at: (3,) point at the center of the image [m].
        distance: distance of the camera from this point [m].
        azimuth: viewing direction [degrees].
        elevation: viewing elevation [degrees], negative from above.
    """

    look_at: tuple[float, float, float] = (-0.12, 0.0, 0.93)
    distance: float = 1.05
    azimuth: float = 148.0
    elevation: float = -24.0


TABLE_VIEW = View()


@dataclass(frozen=True)
class Ghost:
    """A shape at a pose (7,), drawn without being simulated."""

    pose: np.ndarray
    shape: Shape


def _add(scene: mujoco.MjvScene, ghost: Ghost) -> None:
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, ghost.pose[3:])
    geom = scene.geoms[scene.ngeom]
    name, half = half_sizes(ghost.shape)
    kind, color = getattr(mujoco.mjtGeom, f"mjGEOM_{name.upper()}"), np.array(GHOST_COLOR, dtype=np.float32)
    size = np.array(half if name == "box" else (half[0], half[0], half[1] if name != "sphere" else half[0]))
    mujoco.mjv_initGeom(geom, kind, size, ghost.pose[:3], matrix, color)
    scene.ngeom += 1


class _Offscreen:
    """Offscreen image buffer of a model."""

    def __init__(self, model: mujoco.MjModel):
        model.vis.global_.offwidth = max(WIDTH, model.vis.global_.offwidth)
        model.vis.global_.offheight = max(HEIGHT, model.vis.global_.offheight)
        self._model = model
        self._opengl = OpenGL(WIDTH, HEIGHT)
        self._scene = mujoco.MjvScene(model, 2000)
        with self._opengl.current():
            try:
                self._context = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_100)
            except mujoco.FatalError as error:
                raise RenderingUnavailable(" ".join(str(error).split())) from None
            mujoco.mjr_setBuffer(mujoco.mjtFramebuffer.mjFB_OFFSCREEN, self._context)
        self.close = weakref.finalize(self, self._opengl.free, self._context)
        # the backend shuts OpenGL down at exit: free before that, hence registered after it
        self.close.atexit = False
        atexit.register(self.close)

    def image(
        self,
        data: mujoco.MjData,
        camera: mujoco.MjvCamera,
        options: mujoco.MjvOption,
        ghosts: Iterable[Ghost],
    ) -> np.ndarray:
        with self._opengl.current():
            viewport = mujoco.MjrRect(0, 0, WIDTH, HEIGHT)
            every = mujoco.mjtCatBit.mjCAT_ALL
            mujoco.mjv_updateScene(self._model, data, options, None, camera, every, self._scene)
            for ghost in ghosts:
                _add(self._scene, ghost)
            mujoco.mjr_render(viewport, self._scene, self._context)
            pixels = np.empty((HEIGHT, WIDTH, 3), dtype=np.uint8)
            mujoco.mjr_readPixels(pixels, None, viewport, self._context)
        return np.ascontiguousarray(pixels[::-1])


class Renderer:
    """Camera of a scene: images in memory, or MuJoCo's window."""

    def __init__(self, model: mujoco.MjModel, view: View):
        self._model, self._view = model, view
        self._camera = mujoco.MjvCamera()
        self._aim(self._camera)
        self._options = mujoco.MjvOption()
        # visual twins are in group 1, collision geoms in group 0
        self._options.geomgroup[:] = [0, 1, 0, 0, 0, 0]
        self._options.sitegroup[:] = 0
        self._offscreen: _Offscreen | None = None
        self._window: Any = None
        self._told = False

    def image(self, data: mujoco.MjData, ghosts: Iterable[Ghost] = ()) -> np.ndarray:
        """Return an image (HEIGHT, WIDTH, 3) uint8.

        Args:
            data: state to draw.
            ghosts: shapes to draw translucently.

        Raises:
            RenderingUnavailable: no OpenGL library can be used.
        """
        if self._offscreen is None:
            self._offscreen = _Offscreen(self._model)
        return self._offscreen.image(data, self._camera, self._options, ghosts)

    def show(self, data: mujoco.MjData) -> None:
        """Update the window; the first call opens it, if there is a display."""
        if self._window is None and not self._has_display():
            return
        check_not_inherited()
        if self._window is None:
            viewer = import_module("mujoco.viewer")
            note_opened("window")
            self._window = viewer.launch_passive(self._model, data, show_left_ui=False, show_right_ui=False)
            self._aim(self._window.cam)
            self._window.opt.geomgroup[:] = self._options.geomgroup
            self._window.opt.sitegroup[:] = 0
        self._window.sync()

    def close(self) -> None:
        """Free the image buffer and close the window."""
        if self._offscreen is not None:
            self._offscreen.close()
        if self._window is not None:
            self._window.close()
        self._offscreen = self._window = None

    def _has_display(self) -> bool:
        found = bool(os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY"))
        if not found and not self._told:
            LOGGER.warning("no display: the window of render_mode='human' stays closed")
            self._told = True
        return found

    def _aim(self, camera: mujoco.MjvCamera) -> None:
        camera.lookat[:] = self._view.look_at
        camera.distance, camera.azimuth, camera.elevation = (
            self._view.distance,
            self._view.azimuth,
            self._view.elevation,
        )
