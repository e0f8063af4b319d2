"""`onedemo curves`: several trainings in one figure."""
