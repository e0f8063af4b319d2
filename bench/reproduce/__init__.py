"""`onedemo reproduce`: the paper's experiments."""
