"""Changes to robosuite's model before it is compiled: servos instead of its controllers, nothing unused."""

from __future__ import annotations

from xml.etree.ElementTree import Element, SubElement

STIFFNESS, DAMPING = 40.0, 0.04
"""Servo stiffness per torque limit [1/rad], and damping per stiffness [s]: the lag of the servo."""
MAX_COMMAND = 3.0
"""Largest commanded joint speed [rad/s]."""


def use_velocity_servos(root: Element, joints: set[str]) -> None:
    """Replace the torque motors of the arms, keeping their names, and free the robot of gravity."""
    ranges = {joint.get("name"): joint.get("range") for joint in root.iter("joint")}
    actuators = root.find("actuator")
    assert actuators is not None
    for motor in list(actuators.findall("motor")):
        joint = motor.get("joint")
        if joint not in joints:
            continue
        torque = float(motor.get("ctrlrange", "-80 80").split()[1])
        stiffness = STIFFNESS * torque
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
            "actrange": ranges[joint] or "",
            "forcelimited": "true",
            "forcerange": f"{-torque} {torque}",
        }
    for body in root.iter("body"):
        if (body.get("name") or "").startswith(("robot", "gripper")):
            body.set("gravcomp", "1")


def leave_out_unused(root: Element) -> None:
    """Remove what costs time at every step and says nothing: force sensors, a link touching its own base."""
    for sensor in root.findall("sensor"):
        root.remove(sensor)
    names = [body.get("name") or "" for body in root.iter("body")]
    contact = root.find("contact")
    if contact is None:
        contact = SubElement(root, "contact")
    for name in names:
        # MuJoCo leaves out contacts of a link with its parent, but not where the parent is fixed to the world
        if name.endswith("_link0") and f"{name[:-1]}1" in names:
            SubElement(contact, "exclude", {"body1": name, "body2": f"{name[:-1]}1"})
