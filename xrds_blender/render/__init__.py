"""Many frames: a window that slides over a shot."""
