"""Temporal accumulation: the noisy samples of neighbour frames on the pixels of one.

`frame.Frame` is a rendered frame and `frame.store` packs it; `sample_subsets` says
which samples each frame renders under a still camera; `window.Window` yields each frame
of a shot with its neighbours; `accumulate.accumulate` gathers their samples from the
positions that `motion` and `vectors` reproject, weighted by `similarity` and by the
`coarse_rejection` of whole tiles. NumPy alone: no renderer, no denoiser.
"""
