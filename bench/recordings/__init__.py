"""Recordings become demonstrations, and what these show."""
