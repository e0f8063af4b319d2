"""`onedemo plan`: one motion planned, judged and drawn."""
