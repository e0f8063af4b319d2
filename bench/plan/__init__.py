"""`onedemo plan`."""
