"""What a scene holds, read from Blender's data without rendering."""
