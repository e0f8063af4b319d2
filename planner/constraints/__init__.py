"""Compiled constraints: what a demonstration keeps, measured at poses and certified along joint lines; their searches."""
