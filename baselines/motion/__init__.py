"""Methods that move the tool from a pose to a goal: the project's own and the baselines."""
