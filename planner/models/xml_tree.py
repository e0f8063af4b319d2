"""XML files of robot models as trees of elements."""

from __future__ import annotations

import re
from pathlib import Path
from xml.etree.ElementTree import Element, TreeBuilder
from xml.parsers import expat

from ..errors import BadModel

COMMENT = re.compile(rb"<!--.*?-->", re.DOTALL)
ROOT = re.compile(rb"<([A-Za-z_][^\s/>]*)")


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
    except (expat.ExpatError, OSError, ValueError, LookupError) as error:  # the last two: encodings
        raise BadModel(source, kind, f"cannot be read: {error}") from None
    if robot.tag != "robot":
        raise BadModel(source, kind, f"is none: its root is <{robot.tag}>, not <robot>")
    return robot


def root_of(source: Path) -> str:
    """Return the name of a file's root element, also if the file is not well-formed; "" if it has none.

    Args:
        source: the file. Loaders of models are less strict than XML, about dashes in comments for example.

    Raises:
        BadModel: the file cannot be read.
    """
    try:
        found = ROOT.search(COMMENT.sub(b"", source.read_bytes()))
    except OSError as error:
        raise BadModel(source, "robot", f"cannot be read: {error.strerror or error}") from None
    return "" if found is None else found.group(1).decode(errors="replace")
