"""The structures of `accumulate.h`: the same fields in the same order."""

from __future__ import annotations

from ctypes import POINTER, Structure, c_float, c_int32, c_int64, c_uint32, c_void_p


class Frame(Structure):
    """One frame of a shot."""

    _fields_ = (
        ("picture", c_void_p),
        ("noise", c_void_p),
        ("depth", c_void_p),
        ("rims", c_void_p),
        ("counts", c_void_p),
        ("invalid", c_void_p),
        ("parts", POINTER(c_void_p)),
        ("width", c_int32),
        ("height", c_int32),
        ("number", c_uint32),
        ("samples", c_float),
    )


class Reprojection(Structure):
    """From the pixels of one frame to those of another."""

    _fields_ = (
        ("matrix", c_float * 16),
        ("columns", c_void_p),
        ("rows", c_void_p),
        ("left", c_float),
        ("top", c_float),
        ("across", c_float),
        ("down", c_float),
        ("window_x", c_float),
        ("window_y", c_float),
    )


class Places(Structure):
    """Places of some pixels that replace those of the surface."""

    _fields_ = (
        ("pixels", c_void_p),
        ("x", c_void_p),
        ("y", c_void_p),
        ("count", c_int64),
    )


class Neighbour(Structure):
    """A neighbour, and how it is reused."""

    _fields_ = (
        ("frame", Frame),
        ("forth", Reprojection),
        ("back", Reprojection),
        ("turn", c_float * 9),
        ("aligned", c_int32),
        ("jitters", c_int32),
        ("group", c_int32),
        ("tile_rows", c_int32),
        ("tile_columns", c_int32),
        ("whole", c_float),
        ("fall", c_float),
        ("at_rims", c_float),
        ("most", c_float),
        ("tiles", c_void_p),
        ("moving", c_void_p),
        ("moved", Places),
        ("images", Places),
    )


class Target(Structure):
    """The frame that samples are gathered for, and where results go."""

    _fields_ = (
        ("frame", Frame),
        ("guide_noise", c_void_p),
        ("least", c_void_p),
        ("most", c_void_p),
        ("channels", c_int32),
        ("parts", c_int32),
        ("neighbours", c_int32),
        ("guide_area", c_int32),
        ("leads", c_int32),
        ("usual", c_float),
        ("guide_penalty", c_float),
        ("change_penalty", c_float),
        ("all", POINTER(Neighbour)),
        ("guess", c_void_p),
        ("guess_out", c_void_p),
        ("means", c_void_p),
        ("part_means", c_void_p),
        ("samples", c_void_p),
    )


class Pass(Structure):
    """A pass: floats, with steps between rows, pixels and channels."""

    _fields_ = (
        ("first", c_void_p),
        ("row", c_int64),
        ("column", c_int64),
        ("channel", c_int64),
        ("channels", c_int32),
    )


class Packing(Structure):
    """A frame to pack."""

    _fields_ = (
        ("passes", Pass * 4),
        ("halves", Pass * 2),
        ("shares", c_void_p),
        ("signs", c_void_p),
        ("share", c_float),
        ("light_factor", c_float),
        ("guide_factor", c_float),
        ("count", c_int32),
        ("width", c_int32),
        ("height", c_int32),
        ("has_light", c_int32),
        ("picture", c_void_p),
        ("invalid", c_void_p),
        ("noise", c_void_p),
        ("guide_noise", c_void_p),
    )


class Area(Structure):
    """Rows and columns of a picture, the last ones excluded; the first ones even."""

    _fields_ = (
        ("top", c_int32),
        ("bottom", c_int32),
        ("left", c_int32),
        ("right", c_int32),
    )


IN_ORDER = (Frame, Reprojection, Places, Neighbour, Target, Pass, Packing)
"""In the order in which `struct_size` of the library counts them."""
