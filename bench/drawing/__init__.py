"""What all figures share: style and solids."""
