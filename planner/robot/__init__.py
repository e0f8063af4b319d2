"""One arm: its chain, its capsules, read from URDF and MJCF."""
