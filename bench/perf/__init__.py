"""`onedemo perf`: speeds as ratios."""
