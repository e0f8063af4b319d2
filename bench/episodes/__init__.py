"""Scenarios, episodes and their records."""
