"""Episode records for tests."""

from __future__ import annotations

from dataclasses import replace

from onedemo.bench.episodes.episode_records import EpisodeRecord

RECORD = EpisodeRecord(
    cell="0123456789ab",
    index=0,
    seed=7,
    method="screw",
    task="stack",
    robot="Panda",
    level="L1",
    success=True,
    safe=True,
    stage="placed 3 of 3",
    failure_reason="",
    detail="",
    collision="",
    seconds=21.5,
    contacts=0,
    clearance=None,
    refused=0,
    numbers={"position_error": [0.001, 0.002], "yaw_error": [0.01, 0.02]},
    metrics={"clearance": None, "tilt": 0.1},
    wall_seconds=0.5,
    tick_us=[12.0, 60.0, 9000.0, 9000.0],
)


def some(count):
    return [replace(RECORD, index=k, seed=100 + k) for k in range(count)]
