"""Skills: what a demonstration shows, as data; inferred by rules that name no task, or made of named segments."""
