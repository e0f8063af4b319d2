"""Readers of robot models and the fitting of bodies: capsules and hulls that contain the links."""
