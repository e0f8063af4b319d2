"""Execution of jobs on worker processes that may die."""
