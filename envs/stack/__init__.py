"""Stacking blocks, and its single motions."""
