"""`onedemo geometric`: paths without physics."""
