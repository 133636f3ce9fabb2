"""Temporal accumulation: the noisy samples of neighbour frames on the pixels of one.

`frame.Frame` is a rendered frame and `frame.store` packs it; `sample_subsets` says
which samples each frame renders under a still camera. `accumulate.accumulate` gathers
the samples of neighbours: `reprojection`, `object_motion` and `virtual_images` find
their positions, `coarse_rejection` leaves out what shows something else, and
`weighted_sums` weights the rest. NumPy and the compiled core: no renderer, no denoiser.
"""
