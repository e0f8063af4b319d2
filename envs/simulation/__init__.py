"""Simulation of a scene, step by step: physics, obstacles, distances, images; its state as plain arrays for copies."""
