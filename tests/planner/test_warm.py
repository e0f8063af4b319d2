"""Warming up."""

from __future__ import annotations

from random_scenes import panda

from onedemo.planner.warm import warm_up


def test_warming_up_needs_no_more_than_an_arm_and_its_body():
    arm, body, _ = panda()
    warm_up(arm, body)
