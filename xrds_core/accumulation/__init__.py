"""Temporal accumulation: the noisy samples of neighbour frames on the pixels of one.

`frame.Frame` is a rendered frame and `frame.store` packs it; `sample_subsets` says
which samples each frame renders under a still camera; `accumulate.accumulate` gathers
the samples of neighbours from the positions that `reprojection`, `object_motion` and
`virtual_images` find, as `weighted_sums` of all that `coarse_rejection` leaves.
NumPy and the compiled core: no renderer, no denoiser.
"""
