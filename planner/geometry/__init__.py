"""Poses, dual quaternions, screws and convex shapes."""
