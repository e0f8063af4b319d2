"""What is there: robots, objects and fixtures, compiled once."""
