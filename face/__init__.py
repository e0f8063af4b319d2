"""One demonstration in, a robot policy out."""

from __future__ import annotations

from importlib.metadata import version

__version__ = version("onedemo")
