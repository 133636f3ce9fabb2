"""How many samples the next frame of a shot takes, found out as it is rendered."""
