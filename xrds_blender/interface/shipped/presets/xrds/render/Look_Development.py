"""Look development: x4 with guides that are sharper on gloss."""

import bpy

scene = bpy.context.scene

scene.xrds.plain = False
scene.xrds.scale = "4"
scene.xrds.preset = "fast"
scene.xrds.guides = "fast"
scene.xrds.guide_samples = 4
scene.cycles.samples = 32
