"""Values of options that name an object and numbers, like cup=0.06,0.06,0.1."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from ...configs import BadConfig
from ...planner import Pose
from ..console import COMMAND_LINE, check_writable

LARGEST = 2.0
"""Length [m] of an object beyond which its size is asked about: it may be in mm."""
UNIT_QUATERNION = 1e-3
"""Largest deviation of a quaternion's norm from 1 that counts as rounding."""


def check_output(raw: Path, output: Path) -> None:
    """Refuse an output that would replace the recording itself, or that is no .npz file.

    Args:
        raw: the recording.
        output: the demonstration to write.

    Raises:
        BadConfig: one line says why.
    """
    if output.suffix.lower() != ".npz":
        raise BadConfig(COMMAND_LINE, "--output", f"{output} does not end in .npz, as a demonstration does")
    if output.exists() and raw.exists() and output.samefile(raw):
        raise BadConfig(COMMAND_LINE, "--output", f"{output} is the recording itself, which would be lost")
    check_writable("--output", output)


def sizes_of(options: Sequence[str]) -> dict[str, np.ndarray]:
    """Return the sizes (3,) [m] by object of options like "cup=0.06,0.06,0.1".

    Raises:
        BadConfig: another form, or sizes that are not positive, or of no object that a hand moves.
    """
    found = {}
    for option in options:
        name, numbers = _named("--size", option, "cup=0.06,0.06,0.1", (3,))
        if numbers.min() <= 0.0:
            raise BadConfig(
                COMMAND_LINE, "--size", f"{option!r} is not positive; expected lengths, widths, heights [m]"
            )
        if numbers.max() > LARGEST:
            raise BadConfig(COMMAND_LINE, "--size", f"{option!r} is {numbers.max():g} m long: in mm? sizes are in m")
        found[name] = numbers
    return found


def places_of(options: Sequence[str]) -> dict[str, Pose]:
    """Return the poses by name of options like "plate=0.4,0.1,0.02", with or without a quaternion wxyz.

    Raises:
        BadConfig: another form, or a quaternion that is not unit.
    """
    example = "plate=0.4,0.1,0.02 or plate=0.4,0.1,0.02,1,0,0,0"
    named = [_named("--place", option, example, (3, 7)) for option in options]
    return {name: _pose("--place", numbers) for name, numbers in named}


def tool_of(option: str) -> Pose | None:
    """Return the pose of the tcp in the recorded frame, of a text like "0,0,0.1034"; None of an empty one.

    Raises:
        BadConfig: another form, or a quaternion that is not unit.
    """
    if not option:
        return None
    return _pose("--tool", _numbers("--tool", option, option, "0,0,0.1034 or 0,0,0.1034,1,0,0,0", (3, 7)))


def _named(key: str, option: str, example: str, counts: tuple[int, ...]) -> tuple[str, np.ndarray]:
    name, given, text = option.partition("=")
    if not given or not name.strip():
        raise BadConfig(COMMAND_LINE, key, f"{option!r} is no name and numbers, like {example}")
    return name.strip(), _numbers(key, option, text, example, counts)


def _numbers(key: str, option: str, text: str, example: str, counts: tuple[int, ...]) -> np.ndarray:
    try:
        values = np.array([float(word) for word in text.split(",")])
    except ValueError:
        values = np.empty(0)
    if len(values) not in counts or not np.isfinite(values).all():
        wanted = " or ".join(map(str, counts))
        raise BadConfig(COMMAND_LINE, key, f"{option!r} does not give {wanted} numbers, like {example}")
    return values


def _pose(key: str, numbers: np.ndarray) -> Pose:
    quaternion = numbers[3:] if len(numbers) == 7 else np.array([1.0, 0.0, 0.0, 0.0])
    norm = float(np.linalg.norm(quaternion))
    if abs(norm - 1.0) > UNIT_QUATERNION:
        raise BadConfig(COMMAND_LINE, key, f"the quaternion w x y z has norm {norm:.4g}; expected 1")
    return Pose.from_position_quaternion(numbers[:3], quaternion / norm)
