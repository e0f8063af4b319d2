"""`onedemo geometric`: comparison of paths without physics."""
