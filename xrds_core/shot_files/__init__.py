"""Shots in OpenEXR files: read, finished and written, frame by frame.

`frame_file` reads a frame, `sequence` finishes all; `sample_cache` stores samples
before they are denoised, in the form that `frame_file` reads.
"""
