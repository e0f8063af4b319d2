"""Shelving books, and its single motion."""
