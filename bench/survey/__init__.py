"""`onedemo robot survey`: many robots' files loaded, covered, planned for, and judged by true meshes."""
