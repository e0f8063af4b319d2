"""Wanted contacts, asked pair by pair."""

from __future__ import annotations

import numpy as np

from onedemo.envs.judge.judge import unwanted_contacts


def wanted(allowed: np.ndarray, low: int, high: int, following: int = -1) -> bool:
    """Whether the judge wants the contact of two owners, the smaller first; see `unwanted_contacts`."""
    touching = np.zeros_like(allowed)
    touching[low, high] = 1.0
    return unwanted_contacts(touching, allowed, following) == (0, -1, -1)
