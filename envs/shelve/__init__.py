"""Shelving books, and inserting a single one."""
