"""Scripted demonstrations, and demonstrations imported from recordings."""
