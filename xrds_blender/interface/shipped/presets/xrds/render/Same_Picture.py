"""The picture of the file's own samples, in less time."""

import bpy

scene = bpy.context.scene

scene.xrds.mode = "full_size"
scene.xrds.use_time_budget = False
scene.xrds.time_budget = 60.0
scene.xrds.denoise = "high"
scene.xrds.temporal_radius = 4
scene.xrds.animation = "same_picture"
scene.xrds.deadline = 28800.0
scene.xrds.passes = "automatic"
scene.xrds.preset = "fast"
scene.xrds.guide_samples = 4
scene.xrds.use_exposure = False
scene.xrds.exposure = 1.0
