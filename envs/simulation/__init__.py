"""What happens at every step: physics, obstacles, distances, pictures."""
