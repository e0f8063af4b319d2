"""Screw-theoretic planning and control of one arm; knows no simulator and no Gymnasium.

The names below are the public face; each is imported on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from .lazy_names import lazy_names

if TYPE_CHECKING:
    from .control.controller import Controller as Controller
    from .control.controller import ControllerSettings as ControllerSettings
    from .escape.repet import EscapeTree as EscapeTree
    from .escape.repet import RepetSettings as RepetSettings
    from .escape.repet import escape_path as escape_path
    from .fitting.body_readers import body_from_mujoco as body_from_mujoco
    from .fitting.body_readers import body_from_urdf as body_from_urdf
    from .geometry.pose import Pose as Pose
    from .geometry.pose import PosePath as PosePath
    from .geometry.shapes import (
        Box as Box,
    )
    from .geometry.shapes import (
        Capsule as Capsule,
    )
    from .geometry.shapes import (
        Cylinder as Cylinder,
    )
    from .geometry.shapes import (
        Mesh as Mesh,
    )
    from .geometry.shapes import (
        Obstacle as Obstacle,
    )
    from .geometry.shapes import (
        Shape as Shape,
    )
    from .geometry.shapes import (
        Sphere as Sphere,
    )
    from .imitation.demonstration import Demonstration as Demonstration
    from .imitation.demonstration import Segment as Segment
    from .imitation.demonstration_files import (
        read_demonstration as read_demonstration,
    )
    from .imitation.demonstration_files import (
        save_demonstration as save_demonstration,
    )
    from .imitation.tsia import final_path as final_path
    from .imitation.tsia import guide_index as guide_index
    from .imitation.tsia import imitated_path as imitated_path
    from .judge.certify import Certificate as Certificate
    from .judge.certify import certify as certify
    from .log.motion_log import MotionLog as MotionLog
    from .log.motion_log import read_log as read_log
    from .log.motion_log import write_log as write_log
    from .planning.batch import plan_batch as plan_batch
    from .planning.plan import NextMotion as NextMotion
    from .planning.plan import Plan as Plan
    from .planning.plan import PlanRequest as PlanRequest
    from .planning.planner import Planner as Planner
    from .planning.refine import smoothed as smoothed
    from .planning.refine import timed as timed
    from .planning.settings import MotionSettings as MotionSettings
    from .planning.settings import PlanSettings as PlanSettings
    from .reactive.command import Command as Command
    from .reactive.command import ReactiveSettings as ReactiveSettings
    from .reactive.reactive_planner import ReactivePlanner as ReactivePlanner
    from .robot.arm import Arm as Arm
    from .robot.body import Body as Body
    from .safety.safety_layer import SafetyLayer as SafetyLayer
    from .safety.safety_layer import SafetySettings as SafetySettings

__all__ = [
    "Arm",
    "Body",
    "Box",
    "Capsule",
    "Certificate",
    "Command",
    "Controller",
    "ControllerSettings",
    "Cylinder",
    "Demonstration",
    "EscapeTree",
    "Mesh",
    "MotionLog",
    "MotionSettings",
    "NextMotion",
    "Obstacle",
    "Plan",
    "PlanRequest",
    "PlanSettings",
    "Planner",
    "Pose",
    "PosePath",
    "ReactivePlanner",
    "ReactiveSettings",
    "RepetSettings",
    "SafetyLayer",
    "SafetySettings",
    "Segment",
    "Shape",
    "Sphere",
    "body_from_mujoco",
    "body_from_urdf",
    "certify",
    "escape_path",
    "final_path",
    "guide_index",
    "imitated_path",
    "plan_batch",
    "read_demonstration",
    "read_log",
    "save_demonstration",
    "smoothed",
    "timed",
    "write_log",
]

if not TYPE_CHECKING:  # a type checker would take any name for known
    __getattr__, __dir__ = lazy_names(
        __name__,
        {
            ".control.controller": (
                "Controller",
                "ControllerSettings",
            ),
            ".escape.repet": (
                "EscapeTree",
                "RepetSettings",
                "escape_path",
            ),
            ".geometry.pose": (
                "Pose",
                "PosePath",
            ),
            ".geometry.shapes": (
                "Box",
                "Capsule",
                "Cylinder",
                "Mesh",
                "Obstacle",
                "Shape",
                "Sphere",
            ),
            ".imitation.demonstration": (
                "Demonstration",
                "Segment",
            ),
            ".imitation.demonstration_files": (
                "read_demonstration",
                "save_demonstration",
            ),
            ".imitation.tsia": (
                "final_path",
                "guide_index",
                "imitated_path",
            ),
            ".judge.certify": (
                "Certificate",
                "certify",
            ),
            ".log.motion_log": (
                "MotionLog",
                "read_log",
                "write_log",
            ),
            ".planning.batch": ("plan_batch",),
            ".planning.plan": (
                "NextMotion",
                "Plan",
                "PlanRequest",
            ),
            ".planning.planner": ("Planner",),
            ".planning.refine": (
                "smoothed",
                "timed",
            ),
            ".planning.settings": (
                "MotionSettings",
                "PlanSettings",
            ),
            ".reactive.command": (
                "Command",
                "ReactiveSettings",
            ),
            ".reactive.reactive_planner": ("ReactivePlanner",),
            ".robot.arm": ("Arm",),
            ".robot.body": ("Body",),
            ".fitting.body_readers": (
                "body_from_mujoco",
                "body_from_urdf",
            ),
            ".safety.safety_layer": (
                "SafetyLayer",
                "SafetySettings",
            ),
        },
    )
