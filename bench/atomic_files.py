"""Atomic writing of files, and hashes of JSON values."""

from __future__ import annotations

import hashlib
import json
import os
from pathlib import Path
from typing import Any


def canonical(value: Any) -> str:
    """Return the canonical JSON text of a value: sorted keys, no spaces, no NaN."""
    return json.dumps(value, sort_keys=True, separators=(",", ":"), allow_nan=False)


def sha256_of(value: Any) -> str:
    """Return the sha256 of a value's canonical JSON text, in hexadecimal digits."""
    return hashlib.sha256(canonical(value).encode()).hexdigest()


def write_whole(path: Path, text: str) -> None:
    """Write a file atomically: after a crash it has either its old or its new content.

    Args:
        path: file to write; a temporary file is made in the same folder.
        text: whole content of the file.

    Raises:
        OSError: the file cannot be written; its old content is still there.
    """
    part = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with part.open("w", encoding="utf-8") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        part.replace(path)
    except OSError:
        part.unlink(missing_ok=True)
        raise
    folder = os.open(path.parent, os.O_RDONLY)
    try:
        os.fsync(folder)
    finally:
        os.close(folder)
