"""Words of others made harmless: names, stages and errors that stand in reports may hold anything."""

from __future__ import annotations

import os
import re
import unicodedata
from pathlib import Path
from typing import Any

LONGEST = 300
"""Characters of a text that are shown."""
_NO_LINK = re.compile(rb"[^A-Za-z0-9_./-]")
_MARKUP = re.compile(r"([\\|<>\[\]`*_~])")


def plain(value: Any, longest: int = LONGEST) -> str:
    """One line without control characters or marks that turn the direction of writing, cut where it is too long."""
    text = str(value)[: 4 * longest]
    text = "".join(" " if unicodedata.category(c) in ("Cc", "Cf", "Cs", "Zl", "Zp") else c for c in text)
    text = " ".join(text.split())
    return text if len(text) <= longest else text[: longest - 1] + "…"


def markdown_text(value: Any, longest: int = LONGEST) -> str:
    """Text that can neither break a table nor become markup."""
    return _MARKUP.sub(r"\\\1", plain(value, longest))


def csv_text(value: Any) -> str:
    """Text that no spreadsheet takes for a formula."""
    text = plain(value)
    return f"'{text}" if text.startswith(("=", "+", "-", "@")) else text


def slug(value: Any) -> str:
    """A piece of a file name."""
    return re.sub(r"[^a-z0-9_]+", "-", plain(value, 60).lower()).strip("-") or "unnamed"


def link_to(file: Path, folder: Path) -> str:
    """The way from a folder to a file, as links have it: nothing in it can end the link or become markup."""
    relative = os.path.relpath(os.path.realpath(file), os.path.realpath(folder))
    return _NO_LINK.sub(lambda found: b"%%%02X" % found[0][0], os.fsencode(relative)).decode("ascii")
