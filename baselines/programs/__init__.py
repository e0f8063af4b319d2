"""The program that does a skill in the scene at hand, and that of pouring with two hands."""
