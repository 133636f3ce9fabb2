"""Procedural scenes and the training-set generator; not part of the extension."""
