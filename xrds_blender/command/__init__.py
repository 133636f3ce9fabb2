"""The command line: `xrds` and `blender --command xrds`."""
