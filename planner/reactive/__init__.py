"""Algorithm 1, one step per tick."""
