"""Final frames at x2."""

import bpy

scene = bpy.context.scene

scene.xrds.plain = False
scene.xrds.scale = "2"
scene.xrds.preset = "fast"
scene.xrds.guides = "fast"
scene.xrds.guide_samples = 4
scene.cycles.samples = 64
