"""Gymnasium tasks on simulated robots; importing this registers the ids `onedemo/…`."""

from .registration import IDS, register_all
from .task import FAILURES, TaskDescription, TaskObject

__all__ = ["FAILURES", "IDS", "TaskDescription", "TaskObject", "register_all"]

register_all()
