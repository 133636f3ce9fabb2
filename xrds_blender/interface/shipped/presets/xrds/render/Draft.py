"""Quick pictures at x4."""

import bpy

scene = bpy.context.scene

scene.xrds.plain = False
scene.xrds.scale = "4"
scene.xrds.preset = "fast"
scene.xrds.guides = "fast"
scene.xrds.guide_samples = 2
scene.cycles.samples = 16
