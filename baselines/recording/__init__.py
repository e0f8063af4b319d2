"""Scripted demonstrations, and those imported from recordings."""
