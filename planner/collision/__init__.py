"""Distance queries and certificates of clear motions."""
