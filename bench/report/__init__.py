"""`onedemo report`: tables and figures of runs."""
