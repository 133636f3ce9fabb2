"""`xrds stability`: stiff and extreme cases, measured and held to stated bounds.

The checks on arrays need no Blender; those on rendered scenes do.
"""
