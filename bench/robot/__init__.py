"""Robots from files: read, covered, summed up and drawn; motions judged by their true meshes."""
