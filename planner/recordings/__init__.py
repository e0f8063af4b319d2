"""Recordings of other programs, read as demonstrations: tables of poses, teleoperations of simulators."""
