"""Kernels of free space."""
