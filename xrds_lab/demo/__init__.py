"""The demo: one procedural still life, every method side by side."""
