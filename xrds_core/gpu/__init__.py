"""Accumulation on a graphics card of any vendor, by WebGPU."""
