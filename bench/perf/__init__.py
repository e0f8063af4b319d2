"""`onedemo perf`: speed measurements as ratios."""
