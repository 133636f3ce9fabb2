"""What chooses how many samples the frames of a shot take, as they are rendered."""
