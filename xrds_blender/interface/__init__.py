"""What an artist sees in Blender: engine, operators, panels, preferences."""
