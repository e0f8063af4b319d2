"""Solids are merged while their common hull is hardly larger, and every pair's hull is found once."""

from __future__ import annotations

import numpy as np
from helpers.strategies import for_all, st
from scipy.spatial import ConvexHull

from onedemo.planner.fitting import link_pieces
from onedemo.planner.fitting.link_pieces import _merged
from onedemo.planner.fitting.robot_model import Geometry


def solids_of(seed: int, count: int) -> list[Geometry]:
    rng = np.random.default_rng(seed)
    clouds = rng.normal(size=(count, 8, 3)) * 0.02 + rng.uniform(-0.05, 0.05, (count, 1, 3))
    return [Geometry([], points) for points in clouds]


def volume(points: np.ndarray) -> float:
    return float(ConvexHull(points).volume)


@for_all(st.integers(0, 10**6), st.integers(1, 8), st.sampled_from([1.02, 1.5, 3.0]), max_examples=40)
def test_what_is_left_is_not_worth_merging_and_nothing_is_lost(seed, count, bulge):
    solids = solids_of(seed, count)
    left = _merged(solids, bulge)
    hulls = [ConvexHull(solid.points).equations for solid in left]
    for solid in solids:  # whole in one of them
        assert min((solid.points @ planes[:, :3].T + planes[:, 3]).max() for planes in hulls) < 1e-12
    for k, one in enumerate(left):
        for other in left[:k]:
            both = volume(np.vstack([one.points, other.points]))
            assert both > bulge * (volume(one.points) + volume(other.points))


def test_every_hull_is_found_once(monkeypatch):
    """A hand of many convex pieces is merged in seconds."""
    asked = []
    monkeypatch.setattr(link_pieces, "volume", lambda points: asked.append(points.tobytes()) or volume(points))
    count = 16
    assert len(_merged(solids_of(0, count), np.inf)) == 1
    assert len(asked) == len(set(asked)) <= count + count * (count - 1)
