"""Robots from files: read, covered, summed up and drawn."""
