"""Certificates: independent verification of motions that shares no query with the planner."""
