"""Numba kernels: arrays and scalars only."""
