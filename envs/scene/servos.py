"""Changes to robosuite's model before compilation: servos instead of its controllers, unused parts removed."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

STIFFNESS, DAMPING = 40.0, 0.04
"""Servo stiffness per torque limit [1/rad], and damping per stiffness [s], which is the servo's lag."""
LEAST_INERTIA = 0.0064
"""Least rotor inertia of a joint per torque limit [s2]: with less, the servo's damping torque, which is constant
within a physics step, makes the joint oscillate from step to step."""
MAX_COMMAND = 5.0
"""Largest commanded joint speed [rad/s]; actions are bounded by the robot's own limits."""
ENDLESS = 6.28318
"""Limit [rad] of joints that have none: observations are bounded."""
ALWAYS_TOUCH = (
    ("_link0", "_link1"),
    ("_arm_base_link", "_l0"),
    ("_inner_finger", "_inner_knuckle"),
    ("_outer_knuckle", "_inner_knuckle"),
)
"""Name suffixes of neighboring links that touch in every posture."""


def mend_robot(root: Element) -> None:
    """Give endless joints limits, and a pedestal its mesh as collision shape, which would otherwise be a ball."""
    for joint in root.iter("joint"):
        if (joint.get("name") or "").startswith("robot") and joint.get("range") is None:
            joint.set("limited", "true")
            joint.set("range", f"{-ENDLESS} {ENDLESS}")
    for geom in root.iter("geom"):
        if (geom.get("name") or "").endswith("_pedestal_collision"):
            geom.set("type", "mesh")


def use_velocity_servos(root: Element, joints: set[str]) -> None:
    """Replace the arms' torque motors by velocity servos of the same names, and compensate the robot's gravity.

    Args:
        root: root element of the model, changed in place.
        joints: names of the arms' joints.
    """
    by_name = {joint.get("name"): joint for joint in root.iter("joint")}
    actuators = root.find("actuator")
    assert actuators is not None
    for motor in list(actuators.findall("motor")):
        joint = motor.get("joint")
        if joint not in joints:
            continue
        torque = float(motor.get("ctrlrange", "-80 80").split()[1])
        stiffness = STIFFNESS * torque
        driven = by_name[joint]
        driven.set("armature", f"{max(float(driven.get('armature', '0')), LEAST_INERTIA * torque)}")
        motor.tag = "general"
        motor.attrib = {
            "name": motor.get("name", ""),
            "joint": joint,
            "dyntype": "integrator",
            "biastype": "affine",
            "gainprm": f"{stiffness}",
            "biasprm": f"0 {-stiffness} {-DAMPING * stiffness}",
            "ctrllimited": "true",
            "ctrlrange": f"{-MAX_COMMAND} {MAX_COMMAND}",
            "actlimited": "true",
            "actrange": driven.get("range", ""),
            "forcelimited": "true",
            "forcerange": f"{-torque} {torque}",
        }
    for body in root.iter("body"):
        if (body.get("name") or "").startswith(("robot", "gripper")):
            body.set("gravcomp", "1")


def leave_out_unused(root: Element) -> None:
    """Remove parts that cost time at every step without use: force sensors, contacts of links with their neighbors."""
    for sensor in root.findall("sensor"):
        root.remove(sensor)
    names = [body.get("name") or "" for body in root.iter("body")]
    contact = root.find("contact")
    if contact is None:
        contact = SubElement(root, "contact")
    # MuJoCo skips contacts of a link with its parent, except where the parent is fixed to the world
    for first, second in ALWAYS_TOUCH:
        for name in names:
            other = name.removesuffix(first) + second
            if name.endswith(first) and other in names:
                SubElement(contact, "exclude", {"body1": name, "body2": other})
