"""Task programs: the sequence of motions each task requires."""
