"""The path of a segment, for all that takes a demonstration or a path."""

from __future__ import annotations

from ..errors import BadOption, WrongType
from ..geometry.pose import PosePath
from .demonstration import Demonstration


def segment_of(demonstrated: Demonstration | PosePath, segment: str | None = None) -> PosePath:
    """Return the path of the tcp to imitate.

    Args:
        demonstrated: a demonstration, or a path, which is returned as it is.
        segment: name of the demonstration's segment; None: its only one, or the whole path if it has none.

    Raises:
        WrongType: neither a demonstration nor a path.
        BadOption: the demonstration has several segments and none is named, or `segment` is given with a path.
        UnknownName: the demonstration has no segment of that name.
    """
    if isinstance(demonstrated, PosePath):
        if segment is not None:
            raise BadOption("segment", f"{segment!r} is given, but a path has no segments")
        return demonstrated
    if not isinstance(demonstrated, Demonstration):
        raise WrongType("demonstrated", demonstrated, "a Demonstration or a PosePath")
    if segment is not None:
        return demonstrated.segment_path(segment)
    names = [each.name for each in demonstrated.segments]
    if len(names) > 1:
        raise BadOption("segment", f"{demonstrated.name!r} has several: name one of {', '.join(names)}")
    return demonstrated.segment_path(names[0]) if names else demonstrated.path
