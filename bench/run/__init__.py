"""`onedemo run`: a comparison of methods, kept in a run folder."""
