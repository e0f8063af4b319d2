"""Tables of numbers in text files, as many programs write them: any separator, with or without a header."""

from __future__ import annotations

import csv
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..errors import BadDemonstration
from ..imitation.npz_arrays import MAX_BYTES
from .column_names import UNITS

COMMENTS = ("#", "%")
"""Marks at the beginning of a line that is no row; the last such line before the rows may be a header."""
DECIMAL_COMMA = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
DECIMAL_POINT = re.compile(r"[+-]?\d*\.\d*([eE][+-]?\d+)?")
SEPARATORS = {";": "semicolons", "\t": "tabs", "|": "bars", ",": "commas", None: "spaces"}


class TextTable(NamedTuple):
    """Columns of a file.

    Attributes:
        path: of the file, for messages.
        names: of the columns; empty if the file names none.
        columns: each (n,), or the n words of a column that holds none but words.
        lines: (n,) line of the file in which each row stands.
        separator: of the columns in the file; None for spaces.
        notes: what was understood of the file, a line each.
    """

    path: Path
    names: tuple[str, ...]
    columns: tuple[np.ndarray | tuple[str, ...], ...]
    lines: np.ndarray
    separator: str | None = ","
    notes: tuple[str, ...] = ()

    def label(self, k: int) -> str:
        """Return the name of a column for messages."""
        return f"column {self.names[k]!r}" if self.names else f"column {k + 1}"

    def numbers(self, k: int) -> np.ndarray:
        """Return a column (n,) of finite numbers.

        Raises:
            BadDemonstration: one is not finite; the error names the column, the index and the line.
        """
        column = np.asarray(self.columns[k], dtype=np.float64)
        bad = np.flatnonzero(~np.isfinite(column))
        if len(bad):
            where = f"line {self.lines[bad[0]]}" if self.path.suffix != ".npy" else f"row {bad[0]}"
            raise BadDemonstration(self.path, self.label(k), f"is not finite at index {bad[0]} ({where})")
        return column


class _Row(NamedTuple):
    line: int
    fields: list[str]


def read_table(path: Path) -> TextTable:
    """Read a table from a text file, or a 2-dimensional or structured .npy array.

    Args:
        path: of the file.

    Raises:
        BadDemonstration: the file cannot be read, rows differ in length, or a field is no number; the error names the
            line and the column.
    """
    if path.is_dir():
        raise BadDemonstration(path, "file", "is a folder")
    if not path.is_file():
        raise BadDemonstration(path, "file", "does not exist")
    if path.stat().st_size > MAX_BYTES:
        raise BadDemonstration(path, "file", f"has {path.stat().st_size} bytes; at most {MAX_BYTES} are read")
    return _from_npy(path) if path.suffix == ".npy" else _from_text(path)


def _from_npy(path: Path) -> TextTable:
    try:
        array = np.load(path, allow_pickle=False)
    except (ValueError, EOFError, OSError) as error:
        raise BadDemonstration(path, "table", f"cannot be read: {str(error).splitlines()[0]}") from None
    names = array.dtype.names or ()
    if not names and array.ndim == 3 and array.shape[1:] in ((4, 4), (3, 4)):
        array = array.reshape(len(array), -1)
    if names and array.ndim == 1:
        columns = [array[name] for name in names]
    elif not names and array.ndim == 2 and array.dtype.kind in "fiu":
        columns = list(array.T)
    else:
        raise BadDemonstration(path, "table", f"is {array.dtype.name} of shape {array.shape}; expected numbers (n, k)")
    for name, column in zip(names, columns, strict=False):
        if column.dtype.kind not in "fiu" or column.ndim != 1:
            raise BadDemonstration(path, "table", f"field {name!r} is no column of numbers")
    floats = tuple(np.array(column, dtype=np.float64) for column in columns)
    return TextTable(path, tuple(names), floats, np.arange(len(array)))


def _from_text(path: Path) -> TextTable:
    lines = [(k, line) for k, line in enumerate(_decoded(path).splitlines(), 1) if line.strip()]
    remarks = [(k, line) for k, line in lines if line.lstrip().startswith(COMMENTS)]
    rows = [(k, line) for k, line in lines if not line.lstrip().startswith(COMMENTS)]
    if not rows:
        raise BadDemonstration(path, "table", "has no rows")
    separator = _separator(rows[-1][1])
    split = [
        _Row(k, fields) for (k, _), fields in zip(rows, _fields([line for _, line in rows], separator), strict=True)
    ]
    comma = _decimal_comma(path, split, separator)
    header = split.pop(0).fields if _is_header(split[0].fields, comma) else None
    if header is None:
        before = [line.lstrip().lstrip("#% \t") for k, line in remarks if k < split[0].line]
        named = _fields(before[-1:], separator)
        if named and len(named[0]) == len(split[0].fields) and _is_header(named[0], comma):
            header, remarks = named[0], [each for each in remarks if each[1].lstrip("#% \t") != before[-1]]
    if header is not None and split and _holds_units(split[0].fields, len(header)):
        units = [_as_unit(field) for field in split.pop(0).fields]
        header = [f"{name} [{unit}]" if unit else name for name, unit in zip(header, units, strict=True)]
    return _table(path, header, split, separator, comma, len(remarks))


def _table(
    path: Path, header: list[str] | None, rows: list[_Row], separator: str | None, comma: bool, remarks: int
) -> TextTable:
    if not rows:
        raise BadDemonstration(path, "table", "has a header, and no rows")
    if all(row.fields[-1] == "" for row in rows) and (header is None or header[-1] == ""):
        rows = [_Row(row.line, row.fields[:-1]) for row in rows]
        header = header if header is None else header[:-1]
    width = len(rows[0].fields) if header is None else len(header)
    for row in rows:
        if len(row.fields) != width:
            than = "the first row" if header is None else "the header"
            hint = "; is the comma the decimal mark? then semicolons must separate columns" if separator == "," else ""
            raise BadDemonstration(path, f"line {row.line}", f"has {len(row.fields)} fields; {than} has {width}{hint}")
    names = () if header is None else tuple(name.strip() for name in header)
    double = sorted({name for name in names if names.count(name) > 1})
    if double:
        raise BadDemonstration(path, "header", f"names {double[0]!r} twice; name all columns by --columns")
    table = TextTable(path, names, (), np.array([row.line for row in rows]), separator)
    columns = tuple(_column(table, k, [row.fields[k] for row in rows], comma) for k in range(width))
    notes = [f"columns are separated by {SEPARATORS[separator]}" + (", decimals by commas" if comma else "")]
    notes += [f"{remarks} lines of remarks are left out"] if remarks else []
    return table._replace(columns=columns, notes=tuple(notes))


def _decoded(path: Path) -> str:
    data = path.read_bytes()
    encoding = "utf-16" if data[:2] in (b"\xff\xfe", b"\xfe\xff") else "utf-8-sig"
    try:
        return data.decode(encoding)
    except UnicodeDecodeError as error:
        raise BadDemonstration(path, "file", f"is no text: byte {error.start} is not {encoding}") from None


def _separator(line: str) -> str | None:
    """Return what separates the fields of a row; None for spaces."""
    for mark in (";", "\t", "|"):
        if mark in line:
            return mark
    words = line.split()
    spaced = len(words) > 1 and all("," not in word or DECIMAL_COMMA.fullmatch(word) for word in words)
    return None if spaced or "," not in line else ","


def _fields(lines: list[str], separator: str | None) -> list[list[str]]:
    if separator is None:
        return [line.split() for line in lines]
    return [[field.strip() for field in row] for row in csv.reader(lines, delimiter=separator, skipinitialspace=True)]


def _decimal_comma(path: Path, rows: list[_Row], separator: str | None) -> bool:
    """Return whether numbers are written like 0,5."""
    if separator == ",":
        return False
    kinds = {}
    for row in rows:
        for field in row.fields:
            if DECIMAL_COMMA.fullmatch(field):
                kinds.setdefault("comma", (row.line, field))
            elif DECIMAL_POINT.fullmatch(field) and field.strip("+-") != ".":
                kinds.setdefault("point", (row.line, field))
    if len(kinds) == 2:
        (line, word), (other, unlike) = kinds["comma"], kinds["point"]
        raise BadDemonstration(path, f"line {line}", f"writes {word}, line {other} {unlike}: what is the decimal mark?")
    return "comma" in kinds


def _number(field: str, comma: bool) -> float | None:
    if field.lower() in ("true", "false"):
        return float(field.lower() == "true")
    try:
        return float(field.replace(",", ".") if comma else field)
    except ValueError:
        return None


def _is_header(fields: list[str], comma: bool) -> bool:
    words = [field for field in fields if field and _number(field, comma) is None]
    return 2 * len(words) > len(fields)


def _holds_units(fields: list[str], width: int) -> bool:
    return len(fields) == width and any(fields) and all(not field or _as_unit(field) for field in fields)


def _as_unit(field: str) -> str:
    """Return the unit that a field names, like "mm" of "[mm]", else ""."""
    word = field.strip("[]()").strip()
    return word if word == "-" or word.lower() in UNITS else ""


def _column(table: TextTable, k: int, fields: list[str], comma: bool) -> np.ndarray | tuple[str, ...]:
    values = [_number(field, comma) for field in fields]
    bad = [row for row, value in enumerate(values) if value is None]
    if not bad:
        return np.array(values, dtype=np.float64)
    if 2 * len(bad) > len(values) and any(fields):
        return tuple(fields)
    field = fields[bad[0]]
    reason = f"{field!r} is not a number" if field else "is empty"
    raise BadDemonstration(table.path, f"line {table.lines[bad[0]]}", f"{table.label(k)}: {reason}")
