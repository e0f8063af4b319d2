"""Pouring beads, with one arm or two."""
