"""Accumulation: the noisy samples of neighbouring frames on the pixels of one.

`frame.Frame` holds what a renderer gives of one frame and `frame.store` packs it;
`samples.portions` says which samples each frame takes; `window.slide` brings each frame
of a shot with its neighbours; `accumulate.accumulate` gathers their samples from the
places that `motion`, `vectors` and `rigid` find, as far as `survey` and `agreement` see
the same light in them. NumPy alone: no renderer, no denoiser.
"""
