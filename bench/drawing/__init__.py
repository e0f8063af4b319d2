"""Common parts of all figures: style, convex solids, surfaces."""
