"""Model of a robot at a table with objects, built by robosuite.

robosuite's own controllers cost six times the physics and track a path badly. Here every arm joint has MuJoCo's
integrated-velocity servo: the control is a joint speed, whose integral is held by a stiff position servo; the links are
gravity-compensated.
"""

from __future__ import annotations

from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import robosuite
from robosuite.environments.manipulation.manipulation_env import ManipulationEnv
from robosuite.models.arenas import TableArena
from robosuite.models.objects import BoxObject
from robosuite.models.tasks import ManipulationTask
from robosuite.utils.log_utils import ROBOSUITE_DEFAULT_LOGGER
from robosuite.utils.mjcf_utils import CustomMaterial

from .baxter_trunk import slice_trunk
from .mjcf_parts import (
    bead_bodies,
    book_body,
    compound_body,
    furniture_body,
    glass_body,
    mesh_assets,
    obstacle_bodies,
    solid_body,
)
from .scene_objects import TABLE_HALF_SIZE, TABLE_HEIGHT, Book, CompoundBody, FreeBody, Glass, SceneSpec, half_sizes
from .servos import leave_out_unused, mend_robot, use_velocity_servos

TABLE_COLOR = "0.78 0.74 0.68 1"
FRICTION = (1.0, 0.005, 0.0001)
"""Friction coefficients of a wooden block: sliding, torsional, rolling."""


class OneDemoTableScene(ManipulationEnv):
    """Robot, table and objects; used for its model only."""

    def __init__(self, robot: str, gripper: str, spec: SceneSpec, place: tuple[float | None, float]):
        self.spec, self.place = spec, place
        super().__init__(
            robots=robot,
            gripper_types=gripper,
            controller_configs=robosuite.load_composite_controller_config(controller="BASIC"),
            use_camera_obs=False,
            has_renderer=False,
            has_offscreen_renderer=False,
            hard_reset=False,
            ignore_done=True,
            seed=0,
        )

    def _load_model(self) -> None:
        super()._load_model()
        robots: Any = self.robots
        robot_model, side = robots[0].robot_model, 2 * TABLE_HALF_SIZE
        x, y, z = robot_model.base_xpos_offset["table"](side)
        robot_model.set_base_xpos((x if self.place[0] is None else self.place[0], y + self.place[1], z))
        arena: Any = TableArena(table_full_size=(side, side, 0.05), table_offset=(0, 0, TABLE_HEIGHT))
        arena.set_origin([0, 0, 0])
        arena.table_visual.attrib.pop("material", None)
        arena.table_visual.set("rgba", TABLE_COLOR)
        wooden = [_wooden(each) for each in self.spec.objects if isinstance(each, FreeBody) and each.texture]
        self.model = ManipulationTask(arena, [robot_model], wooden)
        self.model.worldbody.extend(_other_bodies(self.spec))
        self.model.asset.extend(mesh_assets(self.spec))
        slice_trunk(self.model.root)
        mend_robot(self.model.root)
        use_velocity_servos(self.model.root, set(robot_model.joints))
        leave_out_unused(self.model.root)

    def reward(self, action: Any = None) -> float:
        """Return 0; robosuite requires a reward."""
        return 0.0


def _other_bodies(spec: SceneSpec) -> list[Element]:
    """Return the bodies that robosuite's own object classes cannot represent."""
    free = [glass_body(each) for each in spec.objects if isinstance(each, Glass)]
    free += [solid_body(each) for each in spec.objects if isinstance(each, FreeBody) and not each.texture]
    free += [book_body(each) for each in spec.objects if isinstance(each, Book)]
    free += [compound_body(each) for each in spec.objects if isinstance(each, CompoundBody)]
    free += [furniture_body(each) for each in spec.furniture]
    beads = bead_bodies(spec.beads) if spec.beads else []
    return [*free, *beads, *obstacle_bodies(spec.obstacles)]


def _wooden(block: FreeBody) -> BoxObject:
    material = CustomMaterial(
        texture=block.texture,
        tex_name=f"{block.name}_texture",
        mat_name=f"{block.name}_material",
        tex_attrib={"type": "cube"},
        mat_attrib={"texrepeat": "1 1", "specular": "0.2", "shininess": "0.05"},
    )
    return BoxObject(
        block.name,
        size=list(half_sizes(block.shape)[1]),
        density=block.density,
        friction=FRICTION,
        material=material,
        rng=np.random.default_rng(0),
    )


def table_env(robot: str, gripper: str, spec: SceneSpec, place: tuple[float | None, float]) -> Any:
    """Return a robosuite environment with the compiled model of a scene.

    Args:
        robot: robosuite's name of the robot.
        gripper: robosuite's name of its gripper, see `Robot`.
        spec: scene contents besides robot and table.
        place: x and y [m] of the robot's base, see `Robot.place`.
    """
    ROBOSUITE_DEFAULT_LOGGER.setLevel("ERROR")
    return OneDemoTableScene(robot, gripper, spec, place)
