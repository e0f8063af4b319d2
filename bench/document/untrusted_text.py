"""Escaping of untrusted text for Markdown, HTML and CSV: names, stages and errors in reports may hold anything."""

from __future__ import annotations

import os
import re
import unicodedata
from pathlib import Path
from typing import Any

LONGEST = 300
"""Largest number of characters of a displayed text."""
_NO_LINK = re.compile(rb"[^A-Za-z0-9_./-]")
_MARKUP = re.compile(r"([\\|<>\[\]`*_~])")


def plain(value: Any, longest: int = LONGEST) -> str:
    """Return a value as one line without control characters or direction marks, cut if too long.

    Args:
        value: any value; its `str` is used.
        longest: largest number of characters.
    """
    text = str(value)[: 4 * longest]
    text = "".join(" " if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") else c for c in text)
    text = " ".join(text.split())
    return text if len(text) <= longest else text[: longest - 1] + "…"


def markdown_text(value: Any, longest: int = LONGEST) -> str:
    """Return a value as text that can neither break a Markdown table nor become markup.

    Args:
        value: any value; its `str` is used.
        longest: largest number of characters before escaping.
    """
    return _MARKUP.sub(r"\\\1", plain(value, longest))


def csv_text(value: Any) -> str:
    """Return a value as text that no spreadsheet interprets as a formula."""
    text = plain(value)
    return f"'{text}" if text.startswith(("=", "+", "-", "@")) else text


def slug(value: Any) -> str:
    """Return a value as a piece of a file name."""
    return re.sub(r"[^a-z0-9_]+", "-", plain(value, 60).lower()).strip("-") or "unnamed"


def link_to(file: Path, folder: Path) -> str:
    """Return the relative path from a folder to a file, escaped so that it can neither end a link nor become markup.

    Args:
        file: target of the link.
        folder: folder of the report.
    """
    relative = os.path.relpath(os.path.realpath(file), os.path.realpath(folder))
    return _NO_LINK.sub(lambda found: b"%%%02X" % found[0][0], os.fsencode(relative)).decode("ascii")
