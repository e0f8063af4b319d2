"""`onedemo train`: training of learners on a task."""
