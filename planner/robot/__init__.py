"""Arms: kinematic chains and link capsules, read from URDF and MJCF."""
