"""Certificates: an independent check that shares no query with the planner."""
