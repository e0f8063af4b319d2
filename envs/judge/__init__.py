"""The compiled judge of all tasks of this project, and the progress that it notes."""
