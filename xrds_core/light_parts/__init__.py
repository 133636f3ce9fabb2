"""Parts of a picture's light: lobes and light groups, which renderers write beside it.

`table` says how they are called and what they are divided by, `find` which ones a file
holds. `light` makes light of passes and passes of light; `sums` and `adding_up` make
denoised parts add up to the denoised picture.
"""
