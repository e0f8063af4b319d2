"""Plans: a demonstration, a start, a goal and obstacles in, joints for every tick out."""
