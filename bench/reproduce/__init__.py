"""`onedemo reproduce`: the paper's experiments on one page."""
