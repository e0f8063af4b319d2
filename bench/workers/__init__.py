"""Jobs on processes that may die."""
