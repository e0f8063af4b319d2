"""What a task asks for, motion by motion."""
