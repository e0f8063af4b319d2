"""robosuite's own tasks: its models, placement and judge, the project's servos and obstacles."""
