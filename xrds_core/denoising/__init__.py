"""Denoising in this process with Open Image Denoise; numpy in and out, no torch.

The library is loaded when the first `Denoiser` is made.
"""

from __future__ import annotations

from .denoiser import QUALITIES, Denoised, Denoiser, denoise
from .oidn_device import DEVICES, devices

__all__ = ["DEVICES", "QUALITIES", "Denoised", "Denoiser", "denoise", "devices"]
