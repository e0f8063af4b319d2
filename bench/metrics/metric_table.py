"""Metrics of an episode: meaning, and format in tables and figures."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True)
class Metric:
    """One metric.

    Attributes:
        words: name in tables.
        unit: unit in tables; "" for a pure number.
        factor: conversion factor from the recorded number to that unit.
        better: "less", "more", or "" if neither is better.
        successes: True if the metric is meaningful for successes only.
        paired: True if methods are compared by it, scenario by scenario.
        meaning: definition in one sentence.
    """

    words: str
    unit: str
    factor: float
    better: str
    successes: bool
    paired: bool
    meaning: str

    @property
    def title(self) -> str:
        """Name and unit."""
        return f"{self.words} [{self.unit}]" if self.unit else self.words


DEGREES = 57.29577951308232
METRICS = {
    "clearance": Metric(
        "clearance", "mm", 1e3, "more", False, True,
        "smallest distance of robot and held object to an obstacle, by python-fcl on the collision geoms; 0: contact",
    ),
    "clearance_robot": Metric(
        "clearance of the robot", "mm", 1e3, "more", False, False, "the same for links, hand and fingers alone"
    ),
    "clearance_held": Metric(
        "clearance of the held object", "mm", 1e3, "more", False, False, "the same for what the fingers hold"
    ),
    "tilt": Metric("tilt", "deg", DEGREES, "less", False, True, "largest tilt of an object while it is carried"),
    "tilt_integral": Metric(
        "tilt integral", "deg s", DEGREES, "less", False, False, "integral of the tilt over carrying"
    ),
    "beads_lost": Metric("beads lost", "", 1.0, "less", False, True, "most beads outside both glasses before pouring"),
    "share_outside": Metric("beads outside", "%", 1e2, "less", False, False, "share outside both glasses at the end"),
    "stack_offset": Metric("stack offset", "mm", 1e3, "less", True, True, "largest distance of a block from its place"),
    "stack_yaw": Metric("stack yaw", "deg", DEGREES, "less", True, False, "largest turn of a block from its place"),
    "reach_offset": Metric("reach offset", "mm", 1e3, "less", True, True, "distance of the hand from its place"),
    "insertion_offset": Metric(
        "insertion offset", "mm", 1e3, "less", True, True, "largest distance of a book from its slot"
    ),
    "insertion_angle": Metric(
        "insertion angle", "deg", DEGREES, "less", True, False, "largest angle of a book to its slot"
    ),
    "path_ratio": Metric(
        "path ratio", "", 1.0, "less", True, True,
        "length of the tcp's way from grasp to release over the demonstration's, mean over the carries",
    ),
    "path_length": Metric("path length", "m", 1.0, "less", True, False, "of the tcp in the whole episode"),
    "rotation_length": Metric("rotation length", "rad", 1.0, "less", True, False, "sum of the tcp's turning"),
    "time_to_goal": Metric("time to goal", "s", 1.0, "less", True, True, "simulated, until the success has settled"),
    "first_motion": Metric("first motion", "s", 1.0, "less", False, False, "simulated, until the first joint moves"),
    "log_dimensionless_jerk": Metric(
        "log jerk", "", 1.0, "more", True, True, "log dimensionless jerk of the tcp's speed, mean over the carries"
    ),
    "sparc": Metric("SPARC", "", 1.0, "more", True, False, "spectral arc length of that speed, mean over carries"),
    "deviation": Metric(
        "method-aligned deviation", "mm", 1e3, "", True, False,
        "Frechet distance to the demonstration moved rigidly to where the carry ended; about zero by construction for "
        "a method that imitates by moving the demonstration, so no measure of merit",
    ),
}  # fmt: skip
"""All metrics by name, in the order of tables."""
