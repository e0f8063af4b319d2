"""Contents of a scene: robots, objects and fixtures, compiled once."""
