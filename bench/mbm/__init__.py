"""`onedemo mbm`: other people's problems, solved to given joints and judged by true meshes."""
