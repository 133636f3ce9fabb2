"""Accumulation: the noisy samples of neighbouring frames on the grid of one.

`frame.Frame` holds what a renderer gives of one frame and `frame.store` packs it for
the window; `window.slide` brings each frame with its neighbours; `accumulate.accumulate`
gathers their samples by the places that `motion` finds; `disagreement` says where the
frame's own samples must count instead. NumPy alone: no renderer, no denoiser.
"""
