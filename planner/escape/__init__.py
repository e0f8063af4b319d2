"""Escape trees of tangent planes (the paper, section III-C and algorithm 2)."""
