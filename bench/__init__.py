"""Running, measuring and reporting."""
