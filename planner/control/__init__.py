"""From a pose to joint speeds."""
