"""Search of clear paths in joint space."""
