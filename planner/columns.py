"""Named columns of packed arrays.

A compiled loop gets one float64 array instead of many arguments. Its rows and columns are named by tables: typed
NamedTuples of ints held in module globals, whose attributes numba compiles to constants.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np


def packed_row(columns: Any, **values: float | Sequence[float] | np.ndarray) -> np.ndarray:
    """Return a row of floats with every value at the columns of its name.

    Args:
        columns: table of the row: a NamedTuple of first columns, with `width`, the number of columns.
        **values: a number, or a sequence of k numbers for k columns, for every name of the table.

    Raises:
        TypeError: a name of the table has no value, or a value no name.
    """
    if set(values) != set(columns._fields) - {"width"}:
        raise TypeError(f"values of {sorted(values)} for {type(columns).__name__}")
    row = np.zeros(columns.width)
    for name, value in values.items():
        first = getattr(columns, name)
        if isinstance(value, Sequence | np.ndarray):
            row[first : first + len(value)] = value
        else:
            row[first] = value
    return row
