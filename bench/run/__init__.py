"""`onedemo run`: a comparison in a folder."""
