"""Shots that lie in OpenEXR files: read, finished and written, frame by frame.

`names` finds the passes in a file, `cameras` the camera in its header; `reading` makes
a frame of both that can lend its samples; `finishing` accumulates and denoises, for
renders in this process too; `denoise` does so for a sequence; `kept` writes frames in
the form that is read here. No renderer, no torch.
"""
