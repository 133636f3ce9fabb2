"""Compiled kernels: C sources, how they are compiled, and the libraries."""
