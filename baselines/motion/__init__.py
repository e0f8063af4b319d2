"""Ways to move the tool from a pose to a goal: the method and its opponents."""
