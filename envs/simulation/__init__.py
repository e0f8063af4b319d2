"""Simulation of a scene, step by step: physics, obstacles, distances, images."""
