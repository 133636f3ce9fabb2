"""Shots in OpenEXR files: read, finished and written, frame by frame.

`names` finds the passes in a file, `cameras` the camera in its header; `reading` makes
a frame of both whose samples can be reused; `finishing` accumulates and denoises, also
for renders in this process; `denoise` does so for a sequence; `sample_cache` writes
frames in the format that is read here. No renderer, no torch.
"""
