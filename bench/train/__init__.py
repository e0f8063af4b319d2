"""`onedemo train`: learners on a task."""
