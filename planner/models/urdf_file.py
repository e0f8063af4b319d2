"""The text of a URDF file: what Pinocchio drops or refuses without naming it is named here."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple
from xml.etree.ElementTree import Element

from ..errors import BadModel
from .model_joints import Coupling
from .model_report import listed
from .xml_tree import parsed_xml

TYPES = ("revolute", "continuous", "prismatic", "fixed", "floating", "planar")
FORMS = {"box": "size", "cylinder": "radius length", "sphere": "radius", "mesh": "filename"}
"""Kinds of geometry, and the attributes each must have."""
SCHEMES = ("package", "file")
"""Schemes of the addresses of meshes; an address without one is a path."""


class UrdfLink(NamedTuple):
    """A link of a URDF file.

    Attributes:
        name: of the link.
        collisions: number of its collision elements.
        visuals: number of its visual elements.
        fault: what is wrong with its collision geometry; "" for nothing.
        visual_fault: what is wrong with its visual geometry; "" for nothing.
    """

    name: str
    collisions: int
    visuals: int
    fault: str
    visual_fault: str


class UrdfFile(NamedTuple):
    """The content of a URDF file, as far as Pinocchio does not show it.

    Attributes:
        source: the file.
        links: by name.
        couplings: joints that mimic others.
        unused: what no reader uses, a line each.
    """

    source: Path
    links: dict[str, UrdfLink]
    couplings: tuple[Coupling, ...]
    unused: tuple[str, ...]


def read_urdf_file(path: str | Path) -> UrdfFile:
    """Read the text of a URDF file.

    Raises:
        BadModel: no such file, no URDF, unexpanded xacro, two of one name, a joint without the limits it needs, links
            that are no tree, or a joint that mimics itself or none.
    """
    source = Path(path)
    if not source.is_file():
        raise BadModel(source, "URDF", "no such file")
    robot = _parsed(source)
    links, joints = robot.findall("link"), robot.findall("joint")
    for element in (robot, *links, *joints):
        if not element.get("name"):
            raise BadModel(source, element.tag, "one has no name")
    for kind, found in (("link", links), ("joint", joints)):
        for name, count in Counter(element.get("name", "") for element in found).items():
            if count > 1:
                raise BadModel(source, f"{kind} {name!r}", f"there are {count} of this name")
    for joint in joints:
        _check_joint(source, joint)
    _check_tree(source, [link.get("name", "") for link in links], joints)
    described = {link.get("name", ""): _link(link) for link in links}
    return UrdfFile(source, described, _couplings(source, joints), tuple(_unused(robot)))


def _parsed(source: Path) -> Element:
    """Return the root element of a URDF file that xacro has expanded."""
    robot = parsed_xml(source, "URDF")
    for element in _described(robot):
        values = [element.tag, *element.attrib.values(), element.text or ""]
        if element.tag.startswith("xacro:") or any(mark in value for value in values for mark in ("${", "$(")):
            reason = "is not expanded; write the URDF first: xacro FILE > robot.urdf"
            raise BadModel(source, f"xacro (<{element.tag}>)", reason)
    return robot


def _described(robot: Element) -> Iterator[Element]:
    """Yield the elements that describe the robot itself, and those of xacro."""
    for child in robot:
        if child.tag in ("link", "joint", "material") or child.tag.startswith("xacro:"):
            yield from child.iter()


def _check_joint(source: Path, joint: Element) -> None:
    key, kind, limit = f"joint {joint.get('name')!r}", joint.get("type"), joint.find("limit")
    if kind not in TYPES:
        raise BadModel(source, key, f"its type is {kind!r}; known are {', '.join(TYPES)}")
    fault = _origin_fault(joint) or _vector_fault(joint, "axis", "xyz")
    for name in ("effort", "velocity"):
        if limit is not None and math.isnan(_number(limit.get(name, "0"))):
            fault = fault or f"the {name} {limit.get(name)!r} of its <limit> is no number"
    if fault:
        raise BadModel(source, key, fault)
    if kind not in ("revolute", "prismatic"):
        return
    if limit is None:
        what = "a joint that turns without end is continuous" if kind == "revolute" else "it needs one"
        raise BadModel(source, key, f"is {kind} and has no <limit>; {what}")
    missing = [name for name in ("effort", "velocity") if limit.get(name) is None]
    if missing:
        raise BadModel(source, key, f"its <limit> has no {' and no '.join(missing)}; a <limit> needs both")
    texts = [limit.get(name, "0") for name in ("lower", "upper")]
    low, high = map(_number, texts)
    if not (low <= high and math.isfinite(high - low)):
        raise BadModel(source, key, f"its limits are {texts[0]!r} and {texts[1]!r}, not two numbers in order")


def _check_tree(source: Path, links: list[str], joints: list[Element]) -> None:
    parents: dict[str, str] = {}
    for joint in joints:
        key, ends = f"joint {joint.get('name')!r}", {}
        for role in ("parent", "child"):
            element = joint.find(role)
            ends[role] = "" if element is None else element.get("link", "")
            if ends[role] not in links:
                raise BadModel(source, key, f"its {role} {ends[role]!r} is no link")
        if ends["child"] in parents:
            raise BadModel(source, f"link {ends['child']!r}", "is the child of two joints")
        parents[ends["child"]] = ends["parent"]
    if not links:
        raise BadModel(source, "links", "there are none; is it a xacro file that was not expanded?")
    roots = [link for link in links if link not in parents]
    if len(roots) != 1:
        raise BadModel(source, "links", f"there must be one root, but there are {len(roots)}: {listed(roots, 8)}")
    hanging = {*roots}
    for _ in links:
        hanging |= {child for child, parent in parents.items() if parent in hanging}
    if loose := [link for link in links if link not in hanging]:
        raise BadModel(source, "links", f"these hang in a circle, not on {roots[0]!r}: {listed(loose, 8)}")


def _link(link: Element) -> UrdfLink:
    collisions, visuals = link.findall("collision"), link.findall("visual")
    faults = [next(filter(None, map(_fault, elements)), "") for elements in (collisions, visuals)]
    return UrdfLink(link.get("name", ""), len(collisions), len(visuals), *faults)


def _fault(element: Element) -> str:
    """Return what is wrong with an element of a link, for which Pinocchio would drop it; "" for nothing."""
    if fault := _origin_fault(element):
        return fault
    geometry = element.find("geometry")
    forms = [] if geometry is None else list(geometry)
    if len(forms) != 1:
        return f"a <{element.tag}> has {len(forms)} shapes instead of one"
    form = forms[0]
    if form.tag not in FORMS:
        return f"its <{form.tag}> is unknown; known are {', '.join(FORMS)}"
    for name in FORMS[form.tag].split():
        text = form.get(name, "")
        if name == "filename" and not text:
            return "a mesh has no filename"
        if name == "filename" and "://" in text and text.partition("://")[0] not in SCHEMES:
            return f"the mesh {text!r} is not at a path, at package:// or at file://"
        if name != "filename" and not _positive(text, 3 if name == "size" else 1):
            return f"the {name} {text!r} of its <{form.tag}> is not positive"
    if not _positive(form.get("scale", "1 1 1"), 3, signed=True):
        return f"the scale {form.get('scale')!r} of a mesh is not three numbers other than 0"
    return ""


def _origin_fault(element: Element) -> str:
    """Return what is wrong with the numbers of an element's <origin>; "" for nothing."""
    return _vector_fault(element, "origin", "xyz") or _vector_fault(element, "origin", "rpy")


def _vector_fault(element: Element, tag: str, name: str) -> str:
    child = element.find(tag)
    text = None if child is None else child.get(name)
    numbers = [_number(word) for word in (text or "0 0 0").split()]
    if len(numbers) == 3 and all(map(math.isfinite, numbers)):
        return ""
    return f"the {name} {text!r} of the <{tag}> of a <{element.tag}> is not three numbers"


def _positive(text: str, count: int, *, signed: bool = False) -> bool:
    numbers = [_number(word) for word in text.split()]
    return len(numbers) == count and all(math.isfinite(x) and (x > 0 or (signed and x < 0)) for x in numbers)


def _number(text: str) -> float:
    """Return the number that a text holds; NaN if it holds something else."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _couplings(source: Path, joints: list[Element]) -> tuple[Coupling, ...]:
    known = {joint.get("name", ""): joint for joint in joints}
    fixed = {name for name, joint in known.items() if joint.get("type") == "fixed"}
    leaders: dict[str, str] = {}
    found = []
    for joint in joints:
        mimic, name = joint.find("mimic"), joint.get("name", "")
        if mimic is None or name in fixed:
            continue
        leader = mimic.get("joint", "")
        if leader not in known:
            raise BadModel(source, f"joint {name!r}", f"mimics {leader!r}, which is no joint")
        numbers = _number(mimic.get("offset", "0")), _number(mimic.get("multiplier", "1"))
        if not all(map(math.isfinite, numbers)):
            raise BadModel(source, f"joint {name!r}", "the multiplier or the offset of its <mimic> is not a number")
        stands = numbers[1] == 0.0 or leader in fixed
        leaders[name] = "" if stands else leader
        found.append(Coupling(name, leaders[name], (numbers[0],) if stands else numbers))
    for name in leaders:
        seen, leader = {name}, leaders[name]
        while leader in leaders:
            if leader in seen:
                raise BadModel(source, f"joint {leader!r}", "mimics itself")
            seen.add(leader)
            leader = leaders[leader]
    return tuple(found)


def _unused(robot: Element) -> Iterator[str]:
    """Yield a line for each kind of content that no reader uses."""
    links, joints = robot.findall("link"), robot.findall("joint")
    massless = [link.get("name", "") for link in links if not _has_inertia(link)]
    endless = [joint for joint in joints if joint.get("type") == "continuous"]
    limits = [(joint.get("name", ""), limit) for joint in endless for limit in joint.iterfind("limit")]
    limited = [name for name, limit in limits if {"lower", "upper"} & {*limit.keys()}]
    soft = [joint.get("name", "") for joint in joints if joint.find("safety_controller") is not None]
    others = Counter(child.tag for child in robot if child.tag not in ("link", "joint", "material"))
    if massless:
        yield f"no or zero inertia, which kinematics does not need: {listed(massless)}"
    if limited:
        yield f"lower and upper limits of continuous joints: {listed(limited)}"
    if soft:
        yield f"soft limits (<safety_controller>) of the joints {listed(soft)}"
    if others:
        yield f"elements outside links and joints: {listed(f'{count} <{tag}>' for tag, count in others.items())}"


def _has_inertia(link: Element) -> bool:
    mass = link.find("inertial/mass")
    return mass is not None and _positive(mass.get("value", ""), 1)
