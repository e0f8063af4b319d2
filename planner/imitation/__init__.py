"""Demonstrations and the task-space imitation algorithm (the paper, section III)."""
