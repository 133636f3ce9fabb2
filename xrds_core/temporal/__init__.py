"""Accumulation: the noisy samples of neighbouring frames on the pixels of one.

`frame.Frame` holds what a renderer gives of one frame and `frame.store` packs it;
`samples` says which samples a frame takes under a still camera; `window.Window` brings
each frame of a shot with its neighbours; `accumulate.accumulate` gathers their samples
from the places that `motion` and `vectors` find, as far as `judge` and `survey` see the
same light in them. NumPy alone: no renderer, no denoiser.
"""
