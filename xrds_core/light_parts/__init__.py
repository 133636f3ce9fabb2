"""Parts of a picture's light: lobes and light groups, which renderers write beside it.

`table` says how they are called and what they are divided by, `find` which ones a file
holds, `adding_up` makes denoised ones add up to the denoised picture.
"""
