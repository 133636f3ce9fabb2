"""Measures shots: what neighbouring frames' samples gain, and what they spoil."""
