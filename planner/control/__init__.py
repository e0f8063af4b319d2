"""Control: joint speeds from poses and paths."""
