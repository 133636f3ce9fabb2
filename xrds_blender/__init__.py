"""The Blender add-on: the XRDS render engine and its commands."""
