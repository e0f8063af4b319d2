"""Stacking blocks, and the single motions of reaching and placing."""
