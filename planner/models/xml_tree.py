"""XML files of robot models as trees of elements."""

from __future__ import annotations

from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ..errors import BadModel


def parsed_xml(source: Path, kind: str) -> Element:
    """Return the root element, <robot>, with prefixes of names as they are: files with undeclared ones are common.

    Args:
        source: the file.
        kind: of the file, for messages: URDF or SRDF.

    Raises:
        BadModel: the file cannot be read, or has another root.
    """
    builder, parser = TreeBuilder(), expat.ParserCreate()
    parser.StartElementHandler, parser.EndElementHandler = builder.start, builder.end
    parser.CharacterDataHandler = builder.data
    try:
        parser.Parse(source.read_bytes(), True)
        robot = builder.close()
    except (expat.ExpatError, OSError) as error:
        raise BadModel(source, kind, f"cannot be read: {error}") from None
    if robot.tag != "robot":
        raise BadModel(source, kind, f"is none: its root is <{robot.tag}>, not <robot>")
    return robot
