"""Learned policies, and the parts of their training that need no torch."""
