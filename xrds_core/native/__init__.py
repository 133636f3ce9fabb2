"""What is compiled: the loops over all pixels of all neighbours of a frame."""
