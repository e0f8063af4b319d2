"""Users' own tasks: a task is data, in one file; one environment and one judge for all of them."""
