"""Robot model files as they are: URDF, SRDF and compiled MJCF models, their joints, and what was not used of them."""
