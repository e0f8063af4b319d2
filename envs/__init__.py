"""Gymnasium tasks on simulated robots; importing this registers the ids `onedemo/…`."""

from .core.description import FAILURES, TaskDescription, TaskObject
from .registration import IDS, register_all

__all__ = ["FAILURES", "IDS", "TaskDescription", "TaskObject", "register_all"]

register_all()
