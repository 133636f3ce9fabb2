"""Cycles: its session, settings, passes and camera."""
