"""One frame, from a scene to a picture."""
