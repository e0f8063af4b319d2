"""Gymnasium tasks on simulated robots."""
