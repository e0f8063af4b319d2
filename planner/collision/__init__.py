"""Distance queries and proofs that a motion is clear."""
