"""Changes to robosuite's model before it is compiled: servos instead of its controllers, nothing unused."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

STIFFNESS, DAMPING = 40.0, 0.04
"""Servo stiffness per torque limit [1/rad], and damping per stiffness [s]: the lag of the servo."""
LEAST_INERTIA = 0.0064
"""Rotor inertia per torque limit [s2] that a joint has at least: with less, the servo's damping, which counts for a
whole step of the physics, throws it back and forth at every step."""
MAX_COMMAND = 5.0
"""Largest commanded joint speed [rad/s]; what an action can ask for is bound by the robot's own limits."""
ENDLESS = 6.28318
"""Limit [rad] given to joints that have none: observations are bounded."""
ALWAYS_TOUCH = (
    ("_link0", "_link1"),
    ("_arm_base_link", "_l0"),
    ("_inner_finger", "_inner_knuckle"),
    ("_outer_knuckle", "_inner_knuckle"),
)
"""Endings of the names of neighboring links that touch in every posture."""


def mend_robot(root: Element) -> None:
    """Give endless joints limits, and a pedestal its own shape: its mesh would be collided with as a ball."""
    for joint in root.iter("joint"):
        if (joint.get("name") or "").startswith("robot") and joint.get("range") is None:
            joint.set("limited", "true")
            joint.set("range", f"{-ENDLESS} {ENDLESS}")
    for geom in root.iter("geom"):
        if (geom.get("name") or "").endswith("_pedestal_collision"):
            geom.set("type", "mesh")


def use_velocity_servos(root: Element, joints: set[str]) -> None:
    """Replace the torque motors of the arms, keeping their names, and free the robot of gravity."""
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
    """Remove what costs time at every step and says nothing: force sensors, links touching their neighbors."""
    for sensor in root.findall("sensor"):
        root.remove(sensor)
    names = [body.get("name") or "" for body in root.iter("body")]
    contact = root.find("contact")
    if contact is None:
        contact = SubElement(root, "contact")
    # MuJoCo leaves out contacts of a link with its parent, but not where the parent is fixed to the world
    for first, second in ALWAYS_TOUCH:
        for name in names:
            other = name.removesuffix(first) + second
            if name.endswith(first) and other in names:
                SubElement(contact, "exclude", {"body1": name, "body2": other})
